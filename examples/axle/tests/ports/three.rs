//! Boards with three motors: `axle sim`, `scan`, `spin` and `stop`.

use serde_json::{Value, json};

use super::{Process, sim};

const TWO_BOARDS: &str = "ikeya-3 --node 1:velocity --node 3:position";

#[test]
fn scan_shows_the_three_values_of_each_board() {
    let (_sim, port) = sim(TWO_BOARDS);
    let table = Process::start(&format!("scan -P ikeya-3 -p {port}")).success();
    assert!(table[1].ends_with("0.00 0.00 0.00 rps"), "{table:?}");
    assert!(table[2].ends_with("0.0000 0.0000 0.0000 turns"), "{table:?}");
    assert_eq!(table.last().unwrap(), "2 nodes answer.");
    let records = Process::start(&format!("scan -P ikeya-3 -p {port} -j")).success();
    let record: Value = serde_json::from_str(&records[0]).unwrap();
    assert_eq!(record["rps"], json!([0.0, 0.0, 0.0]));
}

#[test]
fn a_scan_for_the_other_kind_of_board_finds_none() {
    let (_sim, port) = sim(TWO_BOARDS);
    let scan = Process::start(&format!("scan -p {port}")).success();
    assert!(scan.last().unwrap().starts_with("No node answers on"), "{scan:?}");
}

#[test]
fn spin_turns_the_three_motors_and_stops_them() {
    let (sim, port) = sim(TWO_BOARDS);
    let spin = format!("spin -P ikeya-3 -p {port} -n 1 --rps 1 -2 3 -f 1.5");
    let lines = Process::start(&spin).success();
    assert!(lines[0].ends_with("node 1: target 1.00 -2.00 3.00 rps"), "{lines:?}");
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    sim.line("node 1: command 1.00 -2.00 3.00 rps");
    sim.line("node 1: command 0.00 0.00 0.00 rps");
    sim.line("node 1: at rest at ");

    let spin = format!("spin -P ikeya-3 -p {port} -n 3 --revolutions 0.5 -0.25 0 -f 1.5");
    let lines = Process::start(&spin).success();
    assert!(lines.last().unwrap().contains("0.5000 -0.2500 0.0000 turns"), "{lines:?}");
    sim.line("node 3: at rest at 0.5000 -0.2500 0.0000 turns");
}

#[test]
fn the_number_of_values_must_be_that_of_the_motors() {
    for (args, expected) in [
        ("-P ikeya-3 --rps 1", "with --protocol ikeya-3, --rps and --revolutions take three"),
        ("-P ikeya-3 --revolutions 1 2", "take three values"),
        ("--rps 1 2 3", "with --protocol ikeya, --rps and --revolutions take one value"),
        ("-P ikeya-3 --rps 1 2 -21", "--rps -21 is faster than --max-rps 20"),
    ] {
        let line = Process::start(&format!("spin -p /none -n 1 {args}")).complaint(2);
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn spin_as_json_has_a_target_measurements_a_stop_and_an_outcome() {
    let (_sim, port) = sim(TWO_BOARDS);
    let spin = format!("spin -P ikeya-3 -p {port} -n 1 --rps 1 -2 3 -f 1.5 -j");
    let lines = Process::start(&spin).success();
    let records: Vec<Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(
        records[0],
        json!({"event": "target", "node": 1, "rps": [1.0, -2.0, 3.0], "seconds": 0.0})
    );
    let [target, measured @ .., stopped, outcome] = &records[..] else { panic!("{lines:?}") };
    assert_eq!(target["event"], "target");
    assert!(!measured.is_empty() && measured.iter().all(|it| it["event"] == "measured"));
    assert!(measured.is_sorted_by_key(|it| it["seconds"].as_f64().unwrap()));
    assert_eq!(stopped["event"], "stopped");
    assert_eq!(*outcome, json!({"event": "outcome", "at_rest": true}));
}

#[test]
fn stop_stops_what_a_killed_program_left_turning() {
    let (sim, port) = sim(TWO_BOARDS);
    let spin = Process::start(&format!("spin -P ikeya-3 -p {port} -n 1 --rps 1 2 3 -f 600"));
    sim.line("node 1: turning at 1.00 2.00 3.00 rps");
    spin.kill();
    let lines = Process::start(&format!("stop -P ikeya-3 -p {port} -j")).success();
    let records: Vec<Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = records.iter().map(|it| it["event"].as_str().unwrap()).collect();
    assert_eq!(names, ["stopped", "stopped", "silent", "outcome"]);
    assert_eq!(records[0]["node"], 1);
    assert_eq!(records[2]["nodes"], json!([2, 4, 5, 6, 7, 8]));
    assert_eq!(records[3], json!({"event": "outcome", "at_rest": true}));
    sim.line("node 1: at rest at ");
}
