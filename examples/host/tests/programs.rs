//! Each program as a user runs it, against `axle sim` on a pseudo-terminal.
#![cfg(unix)]

mod support;

use std::process::Command;

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

/// Seconds between two lines of a simulation.
fn seconds(sim: &Process, from: &str, to: &str) -> f64 {
    let at = |what: &str| -> f64 {
        let line = sim.line(what);
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    at(to) - at(from)
}

#[test]
fn spin_turns_a_motor_for_three_seconds_and_stops_it() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let lines = start(env!("CARGO_BIN_EXE_spin"), &port).success();
    assert_eq!(lines, ["found: [(N1, Velocity)]"]);
    sim.line("node 1: turning at 2.00 rps");
    let turned = seconds(&sim, "node 1: command 2.00 rps", "node 1: command 0.00 rps");
    assert!((2.9..20.0).contains(&turned), "{turned} s");
    sim.line("node 1: at rest");
}

#[test]
fn spin_fails_and_commands_nobody_if_its_node_is_missing_or_in_the_other_mode() {
    for (node, found) in
        [("2:velocity", "found: [(N2, Velocity)]"), ("1:position", "found: [(N1, Position)]")]
    {
        let (sim, port) = sim(&format!("ikeya --node {node}"));
        let ended = start(env!("CARGO_BIN_EXE_spin"), &port).end();
        assert_eq!((ended.code, &*ended.stdout), (Some(1), &[found.to_owned()][..]));
        #[cfg(feature = "tokio")]
        {
            let ended = start(env!("CARGO_BIN_EXE_spin_tokio"), &port).end();
            // It looks for node 1 alone.
            let found = if node.starts_with('1') { found } else { "found: []" };
            assert_eq!((ended.code, &*ended.stdout[0]), (Some(1), found));
        }
        assert!(!sim.lines().iter().any(|line| line.contains("rps")), "{:?}", sim.lines());
    }
}

#[test]
fn spin_says_that_the_motor_may_be_running_if_the_line_goes_away() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let spin = start(env!("CARGO_BIN_EXE_spin"), &port);
    sim.line("node 1: command 2.00 rps");
    sim.kill();
    let ended = spin.end();
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr[0].contains("StopsOwed"), "{ended:?}");
}

#[cfg(feature = "tokio")]
#[test]
fn spin_tokio_turns_a_motor_and_stops_it() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let lines = start(env!("CARGO_BIN_EXE_spin_tokio"), &port).success();
    assert_eq!(lines, ["found: [(N1, Velocity)]", "stopped"]);
    sim.line("node 1: turning at 2.00 rps");
    let turned = seconds(&sim, "node 1: command 2.00 rps", "node 1: command 0.00 rps");
    assert!((2.9..20.0).contains(&turned), "{turned} s");
    sim.line("node 1: at rest");
}

#[cfg(feature = "tokio")]
#[test]
fn spin_tokio_stops_the_motor_at_ctrl_c() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let spin = start(env!("CARGO_BIN_EXE_spin_tokio"), &port);
    sim.line("node 1: command 2.00 rps");
    spin.signal("INT");
    assert_eq!(spin.success().last().unwrap(), "stopped");
    let turned = seconds(&sim, "node 1: command 2.00 rps", "node 1: command 0.00 rps");
    assert!(turned < 2.9, "{turned} s");
}

#[test]
fn rover_drives_prints_reports_and_stops() {
    let (sim, port) = sim("ucp");
    let lines = start(env!("CARGO_BIN_EXE_rover"), &port).success();
    let (reports, last) = lines.split_at(lines.len() - 2);
    assert_eq!(last, ["told to stop", "standing still"]);
    assert!(reports.len() > 5, "{reports:?}");
    assert!(reports.iter().all(|line| line.contains(" rpm, ")), "{reports:?}");
    assert!(!reports.last().unwrap().starts_with("[0, 0, 0, 0] rpm"), "{reports:?}");
    let is_charged = |line: &String| line.ends_with(" V") && !line.ends_with(" 0.0 V");
    assert!(reports.iter().all(is_charged), "{reports:?}");
    sim.line("moving");
    let from = "command: speed 30 %, turn 0 %, lamp off";
    let stopped = sim.lines_up_to(from).len();
    let later = sim.lines_up_to("at rest after").split_off(stopped);
    let stop = later.iter().find(|line| line.contains("command: speed 0 %, turn 0 %"));
    let at = |line: &str| -> f64 { line.split_whitespace().next().unwrap().parse().unwrap() };
    let driven = at(stop.expect("a stop")) - at(&sim.line(from));
    assert!((1.8..2.8).contains(&driven), "{driven} s");
}

#[test]
fn rover_says_that_no_robot_answers() {
    // Nobody here understands a host.
    let (sim, port) = sim("ikeya --node 1:velocity");
    let ended = start(env!("CARGO_BIN_EXE_rover"), &port).end();
    let says = (Some(1), &["Error: \"no robot answers\"".to_owned()][..]);
    assert_eq!((ended.code, &*ended.stderr), says);
    assert_eq!(ended.stdout, ["told to stop"]);
    drop(sim);
}

#[test]
fn rover_says_that_the_line_is_lost_while_it_drives() {
    let (sim, port) = sim("ucp");
    let rover = start(env!("CARGO_BIN_EXE_rover"), &port);
    sim.line("moving");
    sim.kill();
    let ended = rover.end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
    assert!(!ended.stdout.iter().any(|line| line == "told to stop"), "{ended:?}");
}

#[test]
fn decode_file_finds_every_frame_of_a_capture() {
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/ucp.bin");
    let lines = start(env!("CARGO_BIN_EXE_decode_file"), capture).success();
    let (last, events) = lines.split_last().unwrap();
    assert_eq!(last, "15 frames, 77 bytes skipped");
    assert_eq!(events.iter().filter(|line| !line.contains("bytes skipped")).count(), 15);
    let offsets: Vec<usize> = events
        .iter()
        .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
        .collect();
    assert!(offsets[0] == 0 && offsets.is_sorted_by(|a, b| a < b), "{offsets:?}");
    let gaps = events.iter().filter_map(|line| {
        let words: Vec<_> = line.split_whitespace().collect();
        (words.get(2..4) == Some(&["bytes", "skipped:"][..]))
            .then(|| words[1].parse::<usize>().unwrap())
    });
    assert_eq!(gaps.sum::<usize>(), 77);
}

#[test]
fn a_program_without_its_argument_asks_for_it() {
    for (program, asks) in [
        (env!("CARGO_BIN_EXE_spin"), "port"),
        (env!("CARGO_BIN_EXE_rover"), "port"),
        (env!("CARGO_BIN_EXE_decode_file"), "file"),
    ] {
        let ended = Process::spawn(&mut Command::new(program)).unwrap().end();
        let says = format!("Error: \"which {asks}?\"");
        assert_eq!((ended.code, &*ended.stderr), (Some(1), &[says][..]));
        let ended = start(program, "/no such file").end();
        assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{program}");
    }
}
