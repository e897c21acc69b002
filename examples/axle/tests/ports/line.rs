//! Each program on pseudo-terminals, once from a simulation to its listing.

use super::{Process, sim};

/// A path for a new file.
fn fresh(name: &str) -> String {
    let path = format!("{}/{name}", env!("CARGO_TARGET_TMPDIR"));
    // It may not be there.
    let _ = std::fs::remove_file(&path);
    path
}

#[test]
fn a_simulated_motor_is_found_turned_stopped_recorded_and_listed() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let found = Process::start(&format!("scan -p {port}")).success();
    assert_eq!(found.last().unwrap(), "1 node answers.");
    let path = fresh("line.pcapng");
    let spin = format!("spin -p {port} -n 1 --rps 2 -f 1 --record {path}");
    let lines = Process::start(&spin).success();
    assert!(lines[0].ends_with("node 1: target 2.00 rps"), "{lines:?}");
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    sim.line("node 1: command 2.00 rps");
    sim.line("node 1: command 0.00 rps");
    sim.line("node 1: at rest");
    let listed = Process::start(&format!("decode {path}")).success();
    assert!(listed[0].trim_start().starts_with("time  dir "), "{listed:?}");
    assert!(listed.iter().any(|line| line.ends_with(" write                      1  2.0 rps")));
}

#[test]
fn a_simulated_rover_is_driven_and_stopped() {
    let (sim, port) = sim("ucp");
    let drive = format!("drive -p {port} --speed 50 --turn 20 -f 1");
    let lines = Process::start(&drive).success();
    assert!(lines[0].ends_with("target: speed 50 %, turn 20 % right"), "{lines:?}");
    assert!(lines.last().unwrap().ends_with(", stopped"), "{lines:?}");
    sim.line("command: speed 50 %, turn 20 % right");
    sim.line("at rest after");
}
