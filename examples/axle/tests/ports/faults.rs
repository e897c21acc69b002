//! The faults of the lines of `axle sim`: each option does what it says.

use std::time::{Duration, Instant};

use axlewire::{
    drive::SerialPort,
    ikeya::{NodeId, ReadRequest},
};
use embedded_io::{Read as _, Write as _};

use super::{Process, TWO_NODES, sim};

/// A READ for node 1.
fn read() -> [u8; 4] {
    *ReadRequest::new(NodeId::N1).as_bytes()
}

/// What is heard for a second, or until there are `enough` bytes, after sending `bytes`.
fn heard(port: &mut SerialPort, bytes: &[u8], enough: usize) -> Vec<u8> {
    port.write_all(bytes).unwrap();
    let (start, mut all) = (Instant::now(), Vec::new());
    while start.elapsed() < Duration::from_secs(1) && all.len() < enough {
        if port.wait(Duration::from_millis(20)).unwrap() {
            let mut buffer = [0; 256];
            let count = port.read(&mut buffer).unwrap();
            all.extend_from_slice(&buffer[..count]);
        }
    }
    all
}

/// A bus with node 1 and these faults, and its port.
fn bus(faults: &str) -> (Process, SerialPort) {
    let (sim, path) = sim(&format!("ikeya --node 1:velocity {faults}"));
    (sim, SerialPort::open(&path, 500_000).unwrap())
}

/// The answer on a clean line: node 1 stands still.
const ANSWER: [u8; 4] = [0x55, 0x01, 0x00, 0x00];

#[test]
fn a_line_without_faults_answers_with_the_packet_alone() {
    let (_sim, mut port) = bus("");
    let answer = heard(&mut port, &read(), 8);
    assert_eq!((&answer[..4], answer.len()), (&ANSWER[..], 8));
    assert_eq!(heard(&mut port, &read(), 9).len(), 8, "and nothing else");
}

#[test]
fn a_stray_byte_comes_in_front_of_each_answer() {
    let (_sim, mut port) = bus("--stray ff");
    for _ in 0..2 {
        let answer = heard(&mut port, &read(), 9);
        assert_eq!((answer[0], &answer[1..5], answer.len()), (0xFF, &ANSWER[..], 9));
    }
}

#[test]
fn a_delay_holds_the_answer_up_in_both_directions() {
    let (_sim, mut port) = bus("--delay 0.15");
    let start = Instant::now();
    assert_eq!(heard(&mut port, &read(), 8).len(), 8);
    assert!(start.elapsed() >= Duration::from_millis(300), "{:?}", start.elapsed());
}

#[test]
fn jitter_holds_bytes_up_and_keeps_their_order() {
    // Less than the pause that ends a request: 20 ms.
    let (_sim, mut port) = bus("--jitter 0.01");
    for _ in 0..5 {
        let start = Instant::now();
        let answer = heard(&mut port, &read(), 8);
        assert_eq!((&answer[..4], answer.len()), (&ANSWER[..], 8));
        // The latest of 4 and the latest of 8: less has a chance of 1 in 200 million.
        assert!(start.elapsed() >= Duration::from_millis(2), "{:?}", start.elapsed());
    }
}

#[test]
fn lost_doubled_and_inserted_bytes_are_seen_in_the_echo_and_in_the_answers() {
    let echo = |faults: &str| {
        let (_sim, mut port) = bus(&format!("--echo {faults}"));
        heard(&mut port, &[0x11; 64], 1000)
    };
    let lost = echo("--lost 0.3");
    assert!((20..64).contains(&lost.len()) && lost.iter().all(|byte| *byte == 0x11));
    let doubled = echo("--duplicated 0.3");
    assert!((65..128).contains(&doubled.len()) && doubled.iter().all(|byte| *byte == 0x11));
    let inserted = echo("--inserted 0.3");
    assert!((65..128).contains(&inserted.len()), "{}", inserted.len());
    assert!(inserted.iter().any(|byte| *byte != 0x11));

    for faults in ["--lost 1", "--duplicated 1", "--inserted 1"] {
        let (_sim, mut port) = bus(faults);
        assert_eq!(heard(&mut port, &read(), 1), [0_u8; 0], "{faults}: no whole request");
    }
}

#[test]
fn noise_damages_bytes_and_the_same_seed_damages_the_same() {
    let answers = |seed: u32| {
        let (_sim, mut port) = bus(&format!("--echo --noise 0.05 --seed {seed}"));
        heard(&mut port, &[0; 64], 64)
    };
    let (one, same, other) = (answers(1), answers(1), answers(2));
    assert_eq!((one.len(), &one), (64, &same));
    assert_ne!(one, other);
    assert_ne!(one, [0; 64]);
}

#[test]
fn with_echo_the_other_program_hears_itself_and_needs_the_option_for_it() {
    let (_sim, mut port) = bus("--echo");
    let answer = heard(&mut port, &read(), 12);
    assert_eq!((&answer[..4], &answer[4..8]), (&read()[..], &ANSWER[..]));

    let (_sim, path) = sim(&format!("{TWO_NODES} --echo"));
    let scan = Process::start(&format!("scan -p {path} --echo")).success();
    assert_eq!(scan.last().unwrap(), "2 nodes answer.", "{scan:?}");
    let spin = Process::start(&format!("spin -p {path} --echo -n 1 --rps 2 -f 1")).success();
    assert!(spin.last().unwrap().ends_with("stopped and confirmed"), "{spin:?}");
}

#[test]
fn an_unplugged_line_lets_nothing_through_until_it_is_plugged_in_again() {
    let (sim, mut port) = bus("--unplug 1.4:1.2");
    sim.line("the line is unplugged");
    assert_eq!(heard(&mut port, &read(), 1), [0_u8; 0]);
    sim.line("the line is plugged in again");
    assert_eq!(heard(&mut port, &read(), 8).len(), 8);
}

#[test]
fn a_dead_node_hears_but_does_not_answer() {
    let (sim, path) = sim(&format!("{TWO_NODES} --dead 3"));
    let scan = Process::start(&format!("scan -p {path}")).success();
    assert_eq!(scan.last().unwrap(), "1 node answers.", "{scan:?}");
    sim.signal("INT");
    let lines = sim.success();
    let last = lines.last().unwrap();
    assert!(last.contains("node 3: 3 READ, 0 WRITE"), "{last}");
}

#[test]
fn a_rover_without_bias_requests_sends_reports_alone() {
    for (option, is_asking) in [("", true), ("--no-bias-requests", false)] {
        let (_sim, path) = sim(&format!("ucp {option}"));
        let mut port = SerialPort::open(&path, 115_200).unwrap();
        let start = Instant::now();
        let mut bytes = Vec::new();
        while start.elapsed() < Duration::from_millis(1500) {
            bytes.extend(heard(&mut port, &[], 64));
        }
        let ids: Vec<u8> = bytes
            .windows(5)
            .filter(|it| it[..2] == [0xFD, 0xFF] && it[3] == 0)
            .map(|it| it[4])
            .collect();
        assert!(ids.contains(&5), "{ids:?}");
        assert_eq!(ids.contains(&8), is_asking, "{option}: {ids:?}");
    }
}

#[test]
fn a_simulation_ends_after_its_time_and_its_events_are_objects() {
    let lines = Process::start("sim ikeya -n 1:velocity --for 0.2 --json").success();
    assert_eq!(lines.len(), 2, "{lines:?}");
    assert!(lines[0].starts_with(r#"{"event":"pty","path":"/dev/"#), "{lines:?}");
    let expected = r#"{"event":"statistics","node":1,"reads":0,"writes":0,"answers":0,"#;
    assert!(lines[1].starts_with(expected), "{lines:?}");

    let sim = Process::start("sim ikeya-3 -n 1:velocity --json");
    let first: serde_json::Value = serde_json::from_str(&sim.line("")).unwrap();
    let path = first["path"].as_str().unwrap();
    let spin = format!("spin -P ikeya-3 -p {path} -n 1 --rps 1 -2 0 -f 1");
    Process::start(&spin).success();
    let command: serde_json::Value =
        serde_json::from_str(&sim.line(r#""event":"command""#)).unwrap();
    assert_eq!(command["rps"], serde_json::json!([1.0, -2.0, 0.0]));
    assert!(command["seconds"].as_f64().unwrap() > 0.0);
    sim.line(r#""event":"at_rest""#);
}

#[test]
fn a_link_is_a_stable_name_that_is_removed_at_the_end() {
    let link = std::env::temp_dir().join(format!("axle-sim-link-{}", std::process::id()));
    let args = format!("sim {TWO_NODES} --link {}", link.display());
    for signal in ["INT", "TERM", "HUP"] {
        let sim = Process::start(&args);
        sim.line("link: ");
        let scan = Process::start(&format!("scan -p {}", link.display())).success();
        assert_eq!(scan.last().unwrap(), "2 nodes answer.");
        sim.signal(signal);
        sim.success();
        assert!(link.symlink_metadata().is_err(), "{signal}");
    }

    // A simulation that was killed leaves its link, which the next one replaces.
    let killed = Process::start(&args);
    killed.line("link: ");
    killed.kill();
    assert!(link.is_symlink());
    let sim = Process::start(&args);
    sim.line("link: ");
    // The link of a simulation that runs is not taken away from it.
    let line = Process::start(&args).complaint(1);
    assert!(line.contains("which is in use"), "{line}");
    assert!(link.is_symlink());
    drop(sim);
    std::fs::remove_file(&link).unwrap();

    std::fs::write(&link, "precious").unwrap();
    let line = Process::start(&args).complaint(1);
    assert!(line.ends_with("something else is there"), "{line}");
    assert_eq!(std::fs::read_to_string(&link).unwrap(), "precious");
    std::fs::remove_file(&link).unwrap();

    std::os::unix::fs::symlink("/etc/hostname", &link).unwrap();
    let line = Process::start(&args).complaint(1);
    assert!(line.contains("it is a link to"), "{line}");
    assert!(link.is_symlink());
    std::fs::remove_file(&link).unwrap();
}
