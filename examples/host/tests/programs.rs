//! Each program as a user runs it, against `axle sim` on a pseudo-terminal.
#![cfg(unix)]

#[path = "../../../tests/support/quiet.rs"]
mod quiet;

mod support;

use std::process::Command;

use quiet::undisturbed;
use support::process::Process;

/// A simulation and the path of its port.
fn sim(args: &str) -> (Process, String) {
    let sim = Process::start(&format!("sim {args}"));
    let first = sim.line("");
    let path = first.strip_prefix("pty: ").expect("the path is the first line").to_owned();
    (sim, path)
}

fn start(program: &str, arg: &str) -> Process {
    Process::spawn(Command::new(program).arg(arg)).unwrap()
}

#[test]
fn spin_turns_a_motor_and_stops_it() {
    undisturbed(|| {
        let (sim, port) = sim("ikeya --node 1:velocity");
        let lines = start(env!("CARGO_BIN_EXE_spin"), &port).success();
        assert_eq!(lines, ["found: [(N1, Velocity)]"]);
        sim.line("node 1: command 2.00 rps");
        sim.line("node 1: turning at 2.00 rps");
        sim.line("node 1: command 0.00 rps");
        sim.line("node 1: at rest");
    });
}

#[test]
fn spin_says_that_the_motor_may_be_running_if_the_line_goes_away() {
    undisturbed(|| {
        let (sim, port) = sim("ikeya --node 1:velocity");
        let spin = start(env!("CARGO_BIN_EXE_spin"), &port);
        sim.line("node 1: command 2.00 rps");
        sim.kill();
        let ended = spin.end();
        assert_eq!(ended.code, Some(1));
        assert!(ended.stderr[0].contains("StopsOwed"), "{ended:?}");
    });
}

#[cfg(feature = "tokio")]
#[test]
fn spin_tokio_turns_a_motor_and_stops_it() {
    undisturbed(|| {
        let (sim, port) = sim("ikeya --node 1:velocity");
        let lines = start(env!("CARGO_BIN_EXE_spin_tokio"), &port).success();
        assert_eq!(lines, ["found: [(N1, Velocity)]", "stopped"]);
        sim.line("node 1: turning at 2.00 rps");
        sim.line("node 1: command 0.00 rps");
        sim.line("node 1: at rest");
    });
}

#[cfg(feature = "tokio")]
#[test]
fn spin_tokio_stops_the_motor_at_ctrl_c() {
    undisturbed(|| {
        let (sim, port) = sim("ikeya --node 1:velocity");
        let spin = start(env!("CARGO_BIN_EXE_spin_tokio"), &port);
        sim.line("node 1: command 2.00 rps");
        spin.signal("INT");
        assert_eq!(spin.success().last().unwrap(), "stopped");
        sim.line("node 1: command 0.00 rps");
    });
}

#[test]
fn rover_drives_prints_reports_and_stops() {
    undisturbed(|| {
        let (sim, port) = sim("ucp");
        let lines = start(env!("CARGO_BIN_EXE_rover"), &port).success();
        let (last, reports) = lines.split_last().unwrap();
        assert_eq!(last, "told to stop");
        assert!(reports.len() > 5, "{reports:?}");
        assert!(reports.iter().all(|line| line.contains(" rpm, ")), "{reports:?}");
        assert!(!reports.last().unwrap().starts_with("[0, 0, 0, 0] rpm"), "{reports:?}");
        sim.line("moving");
        sim.line("at rest after");
    });
}

#[test]
fn decode_file_finds_every_frame_of_a_capture() {
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/ucp.bin");
    let lines = start(env!("CARGO_BIN_EXE_decode_file"), capture).success();
    let (last, events) = lines.split_last().unwrap();
    assert_eq!(last, "15 frames, 77 bytes skipped");
    assert_eq!(events.iter().filter(|line| !line.contains("bytes skipped")).count(), 15);
}

#[test]
fn a_program_without_its_argument_asks_for_it() {
    for program in [env!("CARGO_BIN_EXE_spin"), env!("CARGO_BIN_EXE_rover")] {
        let ended = Process::spawn(&mut Command::new(program)).unwrap().end();
        assert_eq!(
            (ended.code, &*ended.stderr),
            (Some(1), &["Error: \"which port?\"".to_owned()][..])
        );
    }
}
