//! `axle scan`: lists the nodes of a bus.

use std::time::Duration;

use serde_json::{Value, json};

use super::{
    Process, TWO_NODES,
    played::{self, Node, parrot},
    sim,
};

#[test]
fn scan_finds_the_nodes_with_their_modes() {
    let (_sim, port) = sim(TWO_NODES);
    let table = Process::start(&format!("scan --port {port}")).success();
    let rows: Vec<Vec<_>> = table.iter().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[1], ["1", "velocity", "0000", "0010", "0.00", "rps"]);
    assert_eq!(rows[2], ["3", "position", "0101", "0111", "0.0000", "turns"]);
    assert_eq!((&*table[3], table.len()), ("2 nodes answer.", 4));

    let records = Process::start(&format!("scan --json --port {port}")).success();
    let records: Vec<Value> =
        records.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let expected = [
        json!({"event": "node", "node": 1, "mode": "velocity", "rps": 0.0,
               "dip": {"value_plus_one": "0000", "value": "0010"}}),
        json!({"event": "node", "node": 3, "mode": "position", "count": 0, "rotation": 0,
               "dip": {"value_plus_one": "0101", "value": "0111"}}),
        json!({"event": "summary", "nodes": 2, "damaged": 0}),
    ];
    assert_eq!(records, expected);
}

#[test]
fn scan_finds_all_nodes_of_a_noisy_bus_every_time() {
    let nodes: String = (1..=8).map(|node| format!(" --node {node}:velocity")).collect();
    let (_sim, port) = sim(&format!("ikeya --noise 1e-4 --seed 7{nodes}"));
    for _ in 0..5 {
        let table = Process::start(&format!("scan --port {port}")).success();
        assert_eq!(table.last().unwrap(), "8 nodes answer.");
        // Node 8 has no switch setting under the reading in which 1 is 001.
        assert!(table[8].contains("1110") && table[8].contains("none"), "{table:?}");
    }
}

#[test]
fn a_bus_without_nodes_is_no_failure() {
    let line = parrot(&[]);
    let lines = Process::start(&format!("scan --port {}", line.path)).success();
    assert_eq!(lines.len(), 1);
    assert!(lines[0].starts_with(&format!("No node answers on {:?}", line.path)), "{lines:?}");
    let heard = line.lock();
    assert_eq!(heard.len(), 24 * 4, "each id is asked three times");
    assert!(heard.chunks(4).all(|packet| packet[0] == 0xAA), "and nothing else is sent");
}

#[test]
fn a_node_that_answers_with_garbage_for_ever_is_named_and_does_not_hold_anybody_up() {
    let line = parrot(&[0x55, 0x01, 0x55, 0xAA, 0x00, 0xFF, 0x56, 0x03, 0x42, 0x55]);
    let scan = Process::start(&format!("scan --port {}", line.path)).success();
    assert_eq!(scan.iter().filter(|line| line.contains("only damaged answers")).count(), 8);
    assert!(scan.last().unwrap().starts_with("No node answers on"), "{scan:?}");

    let spin = Process::start(&format!("spin --port {} --node 1 --rps 1", line.path));
    assert_eq!(spin.complaint(1), "node 1 does not answer; nodes that do: none");
    let heard = line.lock();
    assert!(!heard.contains(&0xBB), "no node was commanded");
}

#[test]
fn a_direct_line_has_to_answer_at_once_and_an_adapter_has_20_ms() {
    // Only a stall of the machine can change a result: at 8 ms, 12 are left until the adapter's
    // time is up; at 15 ms, a direct line is that much too late.
    for (delay_ms, option, expected) in
        [(8, "", "1 node answers."), (15, "--reply-timeout direct", "No node answers in time on")]
    {
        let slow = Node { delay: Duration::from_millis(delay_ms), ..Node::velocity(1) };
        let line = played::bus(&[slow], |_, _| {});
        let scan = Process::start(&format!("scan {option} --port {}", line.path)).success();
        assert!(scan.last().unwrap().starts_with(expected), "{scan:?}");
    }
}

#[test]
fn the_times_of_answers_are_measured_and_the_option_that_they_need_is_named() {
    // The 80 us of a READ on the line are not part of the time of its answer.
    for (line, least_us, option) in
        [("", 0, "direct"), ("--delay 0.004", 7_920, "usb"), ("--delay 0.02", 39_920, "network")]
    {
        let (_sim, port) = sim(&format!("{TWO_NODES} {line}"));
        let records = Process::start(&format!("scan --measure --json --port {port}")).success();
        let records: Vec<Value> =
            records.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        let times: Vec<_> = records.iter().filter(|record| record["event"] == "times").collect();
        assert_eq!(times.len(), 2, "{records:?}");
        for times in times {
            assert_eq!(times["answers"], times["reads"], "{times}");
            let micros = ["min_us", "median_us", "p90_us", "p99_us", "max_us"]
                .map(|name| times[name].as_u64().unwrap());
            assert!(micros.is_sorted() && micros[0] >= least_us, "{times}");
        }
        let proposal = records.last().unwrap()["reply_timeout"].as_str().unwrap();
        // A machine with other work to do may have been late once.
        assert!(least_us == 0 || !["direct"].contains(&proposal), "{line}: {proposal}");
        let scan = Process::start(&format!("scan --reply-timeout {option} --port {port}"));
        assert_eq!(scan.success().last().unwrap(), "2 nodes answer.", "{line}");
    }
}

#[test]
fn a_pseudo_terminal_may_answer_before_its_line_speed_allows() {
    // At 9600 bit/s a READ and its answer take 12 ms.
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let link = std::env::temp_dir().join(format!("axle-link-{}", std::process::id()));
    std::os::unix::fs::symlink(&line.path, &link).unwrap();
    let scan = Process::start(&format!("scan --baud 9600 --port {}", link.display()));
    let lines = scan.success();
    std::fs::remove_file(&link).unwrap();
    assert_eq!(lines.last().unwrap(), "1 node answers.", "{lines:?}");
}

#[test]
fn a_line_on_which_answers_come_late_is_scanned_moved_on_and_stopped_and_its_option_is_named() {
    for line in ["--delay 0.011", "--delay 0.05 --jitter 0.02", "--delay 0.2"] {
        let (sim, port) = sim(&format!("{TWO_NODES} {line}"));
        let scan = Process::start(&format!("scan --port {port}")).success();
        let [rest @ .., says, count] = scan.as_slice() else { panic!("{scan:?}") };
        assert_eq!((rest.len(), &**count), (3, "2 nodes answer."), "{line}: {scan:?}");
        let option = says.strip_prefix("answers come late: use ").unwrap();
        let option = option.strip_suffix(" on this line").unwrap();
        let spin = format!("spin --port {port} --node 1 --rps 1 --for 1");
        let complaint = Process::start(&spin).complaint(1);
        assert!(complaint.starts_with("node 1 does not answer"), "{complaint}");
        let spin = Process::start(&format!("{spin} {option}")).end();
        let last = spin.stdout.last().unwrap();
        assert!(last.ends_with("stopped and confirmed"), "{line}: {last}");
        sim.line("command 1.00 rps");
        // Commanded again by another program, which was killed.
        let spin = format!("spin --port {port} --node 1 --rps 3 --for 600 {option}");
        let killed = Process::start(&spin);
        sim.line("command 3.00 rps");
        killed.kill();
        let stop = Process::start(&format!("stop --port {port} --protocol ikeya")).end();
        assert_eq!((stop.code, stop.stdout.len()), (Some(0), 3), "{line}: {stop:?}");
        sim.line("node 1: at rest");
        assert!(stop.stderr[0].starts_with("axle: answers come late: "), "{:?}", stop.stderr);
    }
}

#[test]
fn a_line_on_which_answers_come_later_than_anything_waits_is_told_from_a_dead_one() {
    let (_sim, port) = sim(&format!("{TWO_NODES} --delay 0.3"));
    for measure in ["", "--measure"] {
        let scan = Process::start(&format!("scan --port {port} {measure}")).success();
        let [says] = scan.as_slice() else { panic!("{scan:?}") };
        let expected = format!(
            "No node answers in time on {port:?}, but later: use a longer --reply-timeout."
        );
        assert_eq!(*says, expected);
    }
    let scan = Process::start(&format!("scan --reply-timeout 1 --port {port}")).success();
    assert_eq!(scan.last().unwrap(), "2 nodes answer.");
}

#[test]
fn nodes_that_fall_silent_while_they_are_measured_are_no_line_without_nodes() {
    let (_sim, port) = sim(&format!("{TWO_NODES} --delay 0.005 --unplug 2.5:600"));
    let scan = Process::start(&format!("scan --port {port} --measure")).end();
    let says = "0 of 2 nodes still answer.".to_owned();
    assert_eq!((scan.code, scan.stdout.last()), (Some(1), Some(&says)), "{scan:?}");
    assert_eq!(scan.stderr, ["axle: 2 nodes fell silent"]);
}
