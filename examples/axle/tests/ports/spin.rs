//! `axle spin`: turns one motor, and stops it before the tool exits.

use std::{
    io::{Read, Write},
    process::Stdio,
    thread,
    time::{Duration, Instant},
};

use axlewire::ikeya::Mode;

use super::{
    Process, TWO_NODES,
    played::{self, Node, Said, confirmable_stops, speeds},
    sim,
    support::axle,
    values, wait_until,
};

#[test]
fn spin_turns_the_motor_and_stops_it_at_the_end() {
    let (sim, port) = sim(TWO_NODES);
    let lines =
        Process::start(&format!("spin --port {port} --node 1 --rps -2.5 --for 1")).success();
    assert!(lines[0].contains("node 1: target -2.50 rps"), "{lines:?}");
    let (stopped, measured) = lines[1..].split_last().unwrap();
    let measured = values(measured, "rps");
    assert!(!measured.is_empty() && measured.is_sorted_by(|a, b| a >= b), "{measured:?}");
    assert!(*measured.last().unwrap() < -2.0, "{measured:?}");
    assert!(stopped.ends_with("stopped and confirmed"), "{stopped}");

    sim.line("node 1: command -2.50 rps");
    sim.line("node 1: command 0.00 rps");
    sim.line("node 1: at rest");
    assert!(!sim.lines().iter().any(|line| line.contains("node 3")), "only node 1 was commanded");
}

#[test]
fn a_position_node_goes_on_from_where_it_stands() {
    let (sim, port) = sim(TWO_NODES);
    for expected in ["-0.7500", "-1.5000"] {
        let spin = format!("spin --port {port} --node 3 --revolutions -0.75 --for 1");
        let lines = Process::start(&spin).success();
        assert!(lines[0].contains(&format!("target {expected} turns")), "{lines:?}");
        assert!(lines.last().unwrap().contains(expected), "{lines:?}");
        sim.line(&format!("node 3: at rest at {expected} turns"));
    }
}

#[test]
fn a_position_node_under_way_is_stopped_where_it_is() {
    let (sim, port) = sim(TWO_NODES);
    let spin = format!("spin --port {port} --node 3 --revolutions 1000 --for 0.3");
    let ended = Process::start(&spin).end();
    let (lines, complaint) = (ended.stdout, &ended.stderr[0]);
    let expected = "axle: node 3 was at ";
    assert!(ended.code == Some(1) && complaint.starts_with(expected), "{complaint}");
    let expected = " turns when the time was up, target 1000.0000 turns; it was stopped and is \
                    at rest";
    assert!(complaint.ends_with(expected), "{complaint}");
    sim.line("node 3: at rest");
    let commands: Vec<_> =
        sim.lines().into_iter().filter(|line| line.contains("command")).collect();
    let [goal, hold] = values(&commands, "turns")[..] else { panic!("{commands:?}") };
    assert_eq!(goal, 1000.0);
    assert!(hold > 0.0 && hold < 900.0, "neither the goal nor back at 0: {hold}");
    assert_eq!(values(&lines[lines.len() - 1..], "turns"), [hold]);
}

#[test]
fn a_way_that_is_too_long_for_its_time_is_no_success() {
    let (_sim, port) = sim(TWO_NODES);
    let spin = format!("spin -p {port} -n 3 --revolutions 8000 -f 1 --json");
    let ended = Process::start(&spin).end();
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr[0].contains(" when the time was up, target 8000.0000 turns"));
    let outcome: serde_json::Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!((&outcome["event"], &outcome["at_rest"]), (&"outcome".into(), &true.into()));
    let failure = outcome["failure"].as_str().unwrap();
    assert_eq!(ended.stderr, [format!("axle: {failure}")]);
}

#[test]
fn a_reader_that_goes_away_stops_the_motor_too() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --port {port} --node 1 --rps 3 --for 600");
    let args: Vec<_> = args.split(' ').collect();
    let mut spin = axle(&args).stdout(Stdio::piped()).spawn().unwrap();
    let mut first = [0; 8];
    spin.stdout.take().unwrap().read_exact(&mut first).unwrap();
    sim.line("node 1: command 0.00 rps");
    assert_eq!(spin.wait().unwrap().code(), Some(0));
}

#[test]
fn an_output_that_takes_nothing_moves_nothing() {
    let bus = played::bus(&[Node::velocity(1)], |_, _| {});
    let rover = played::rover(None);
    for args in [
        format!("spin -p {} -n 1 --rps 2 -f 0.5", bus.path),
        format!("drive -p {} --speed 20 --turn 0 -f 0.5", rover.path),
        format!("send -p {} -f 0 ikeya read 1", bus.path),
    ] {
        let args: Vec<_> = args.split(' ').collect();
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let output = axle(&args).stdout(full).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.starts_with("axle: cannot write the output: "), "{error}");
        assert_eq!(output.status.code(), Some(1));
    }
    assert!(speeds(&bus.said()).is_empty());
    assert!(rover.lock().commands.iter().all(|command| *command == (0, 0)));
}

#[test]
fn a_port_that_vanishes_is_reported_with_what_it_means() {
    let (sim, port) = sim(TWO_NODES);
    let spin = Process::start(&format!("spin --port {port} --node 1 --rps 2 --for 600"));
    sim.line("node 1: command 2.00 rps");
    sim.kill();
    let line = spin.complaint(1);
    assert!(line.starts_with(&format!("port {port:?} failed: disconnected")), "{line}");
    let end = "; node 1 was told to stop and has not confirmed it: it may be moving";
    assert!(line.ends_with(end), "{line}");
}

#[test]
fn a_command_for_the_wrong_mode_or_an_unknown_node_moves_nothing() {
    let (sim, port) = sim(TWO_NODES);
    let cases = [
        ("--node 3 --rps 1", "node 3 is in position mode: use --revolutions"),
        ("--node 1 --revolutions 1", "node 1 is in velocity mode: use --rps"),
        ("--node 5 --rps 1", "node 5 does not answer; nodes that do: 1 (velocity), 3 (position)"),
    ];
    for (args, expected) in cases {
        let spin = Process::start(&format!("spin --port {port} {args}"));
        assert_eq!(spin.complaint(1), expected);
    }
    sim.signal("INT");
    let lines = sim.success();
    assert!(!lines.iter().any(|line| line.contains("command")), "{lines:?}");
    assert!(lines[1..].iter().all(|line| line.contains(" 0 WRITE")), "{lines:?}");
}

#[test]
fn the_watchdog_of_a_simulated_node_stops_it_when_its_master_dies() {
    let (sim, port) = sim("ikeya --node 1:velocity --watchdog 0.5");
    let spin = Process::start(&format!("spin --port {port} --node 1 --rps 2 --for 600"));
    sim.line("node 1: command 2.00 rps");
    spin.kill();
    sim.line("node 1: watchdog");
    sim.line("node 1: at rest");
    // What a killed program leaves behind does not block the next one.
    let again = Process::start(&format!("scan --port {port}")).success();
    assert_eq!(again.last().unwrap(), "1 node answers.");
}

#[test]
fn the_time_that_was_asked_for_is_kept() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let args = format!("spin --port {} --node 1 --rps 2 --for 0.7", line.path);
    Process::start(&args).success();
    let at = |rps: f32| {
        let is_it = |said: &Said| matches!(said, Said::Write(1, it, _) if *it == rps);
        line.lock().said.iter().find(|(said, _)| is_it(said)).unwrap().1
    };
    let turned = (at(0.0) - at(2.0)).as_secs_f64();
    assert!((0.65..1.2).contains(&turned), "{turned} s");
}

#[test]
fn a_motor_that_does_not_reach_its_speed_is_a_failure() {
    let line = played::bus(&[Node { follows: false, ..Node::velocity(1) }], |_, _| {});
    line.change(|node| node.rps = 1.7);
    let spin = played::spin(&line, 0.3);
    wait_until("the stop", || speeds(&line.said()).contains(&0.0));
    line.change(|node| node.rps = 0.0);
    let expected = "node 1 was at 1.70 rps when the time was up, target 2.00 rps; it was stopped \
                    and is at rest";
    assert_eq!(spin.complaint(1), expected);
}

#[test]
fn a_motor_that_turns_on_after_its_stop_is_not_called_stopped() {
    let line = played::bus(&[Node { follows: false, ..Node::velocity(1) }], |_, _| {});
    line.change(|node| node.rps = 2.0);
    let args = format!("spin --port {} --node 1 --rps 2 --for 0.2 --json", line.path);
    let ended = Process::start(&args).end();
    let expected = "node 1 confirmed the stop, but is still moving after 2 s: 2.00 rps";
    assert_eq!((ended.code, &*ended.stderr), (Some(1), &[format!("axle: {expected}")][..]));
    assert!(!ended.stdout.iter().any(|line| line.contains("\"stopped\"")), "{ended:?}");
    let outcome = serde_json::json!(
        {"event": "outcome", "at_rest": false, "failure": expected}
    );
    let last: serde_json::Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!(last, outcome);
}

#[test]
fn a_node_that_falls_silent_is_stopped_when_it_is_back() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    // It neither receives nor answers for a while, and continues with its last command.
    line.change(|node| (node.is_dumb, node.follows) = (true, false));
    let before = line.said().len();
    wait_until("the stop", || speeds(&line.said()[before..]).contains(&0.0));
    thread::sleep(Duration::from_millis(500));
    line.change(|node| (node.is_dumb, node.follows) = (false, true));
    let expected = "node 1 no longer answers; it was stopped and is at rest";
    assert_eq!(spin.complaint(1), expected);
    assert_eq!(line.lock().nodes[0].rps, 0.0);
}

#[test]
fn a_node_that_stays_silent_is_told_to_stop_all_the_same() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    // It still receives, but no longer answers.
    line.change(|node| node.is_dumb = true);
    let expected = "node 1 was told to stop and has not confirmed it (nothing received): it may \
                    be moving";
    assert_eq!(spin.complaint(1), expected);
    assert_eq!(line.lock().nodes[0].rps, 0.0);
    assert!(confirmable_stops(&line.said(), 1) >= 3, "{:?}", speeds(&line.said()));
}

#[test]
fn a_mode_that_changes_between_discovery_and_command_moves_nothing() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        let reads = bus.said.iter().filter(|(said, _)| *said == Said::Read(1)).count();
        if said == Said::Read(1) && reads > 1 {
            bus.nodes[0].mode = Mode::Position;
        }
    });
    let spin = Process::start(&format!("spin --port {} --node 1 --rps 2 --for 600", line.path));
    assert_eq!(spin.complaint(1), "node 1 is in position mode: use --revolutions");
    assert!(speeds(&line.said()).is_empty(), "{:?}", speeds(&line.said()));
}

#[test]
fn a_node_that_changes_its_mode_is_stopped_in_the_new_one() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    // A position whose bytes are also a valid speed.
    let before = {
        let mut bus = line.lock();
        let node = &mut bus.nodes[0];
        // A command in flight does not move it, so that the hold can be told from the speed.
        (node.mode, node.counts, node.follows) = (Mode::Position, HELD, false);
        bus.said.len()
    };
    let complaint = spin.complaint(1);
    // Depending on which it detects first.
    let is_mode = ["node 1 has answered in position mode", "node 1 has changed to position mode"]
        .iter()
        .any(|start| complaint.starts_with(start));
    assert!(is_mode, "{complaint}");
    assert!(complaint.ends_with("it was stopped and is at rest"), "{complaint}");
    let writes = line.said()[before..].to_vec();
    let writes: Vec<_> = writes.iter().filter(|said| matches!(said, Said::Write(..))).collect();
    // One command may have been in flight when the switch was moved.
    let from = usize::from(matches!(writes[0], Said::Write(1, 2.0, _)));
    let holds = &writes[from..];
    let is_hold = |said: &&Said| matches!(said, Said::Write(1, _, to) if *to == HELD);
    assert!(holds.len() >= 2 && holds.iter().copied().all(|said| is_hold(&said)), "{writes:?}");
}

/// Position of the node that changes its mode.
const HELD: i32 = 8192 * 16_000;

#[test]
fn a_node_that_changes_its_mode_while_it_is_stopped_is_stopped_in_the_new_one() {
    let line = played::bus(&[Node { follows: false, ..Node::velocity(1) }], |said, bus| {
        // On the first stop that it receives.
        if matches!(said, Said::Write(1, 0.0, 0)) {
            (bus.nodes[0].mode, bus.nodes[0].counts) = (Mode::Position, HELD);
        }
    });
    line.change(|node| node.rps = 2.0);
    let args = format!("spin --port {} --node 1 --rps 2 --for 0.3", line.path);
    let lines = Process::start(&args).success();
    assert!(lines.last().unwrap().contains("16000.0000 turns, stopped"), "{lines:?}");
    let is_hold = |said: &&Said| matches!(said, Said::Write(1, _, HELD));
    assert!(line.said().iter().filter(is_hold).count() >= 2, "{:?}", speeds(&line.said()));
}

#[test]
fn a_stop_with_the_mode_in_doubt_is_not_called_stopped() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        let node = &mut bus.nodes[0];
        match said {
            // On the first stop its mode changes. It reports that once and then falls silent.
            Said::Write(1, 0.0, 0) => (node.mode, node.counts) = (Mode::Position, HELD),
            Said::Read(1) if node.mode == Mode::Position => {
                node.is_dumb = bus.said.iter().filter(|(said, _)| *said == IS_HEARD).count() > 0;
                bus.said.push((IS_HEARD, Instant::now()));
            }
            _ => {}
        }
    });
    let spin = played::spin(&line, 0.5);
    let expected = "the mode of node 1 is in doubt, so it cannot be stopped: it may be moving";
    assert_eq!(spin.complaint(1), expected);
}

/// A marker that a test adds among the requests.
const IS_HEARD: Said = Said::Read(99);

#[test]
fn a_reader_that_does_not_read_keeps_no_stop_from_being_sent() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let (reader, mut writer) = std::io::pipe().unwrap();
    let args = format!("spin --port {} --node 1 --rps 2 --for 600", line.path);
    let args: Vec<_> = args.split(' ').collect();
    let mut spin =
        axle(&args).stdout(writer.try_clone().unwrap()).stderr(Stdio::piped()).spawn().unwrap();
    // The tool's first line comes before the motor turns. After that nothing reads, and the
    // pipe is full.
    wait_until("2 rps", || speeds(&line.said()).contains(&2.0));
    let flood = thread::spawn(move || writer.write_all(&[b' '; 1 << 20]));
    thread::sleep(Duration::from_millis(1500));
    let pid = spin.id();
    let before = line.said().len();
    let kill = std::process::Command::new("sh").args(["-c", &format!("kill -INT {pid}")]).status();
    assert!(kill.unwrap().success());
    wait_until("the stop", || speeds(&line.said()).contains(&0.0));
    let after = speeds(&line.said()[before..]);
    let stop = after.iter().position(|&rps| rps == 0.0).expect("a stop");
    assert!(stop <= 25, "at once, not after the output has timed out: {after:?}");
    let status = spin.wait().unwrap();
    let mut complaint = String::new();
    spin.stderr.take().unwrap().read_to_string(&mut complaint).unwrap();
    assert_eq!(status.code(), Some(1), "{complaint}");
    assert_eq!(complaint, "axle: cannot write the output: the reader has stalled\n");
    drop(reader);
    assert!(flood.join().unwrap().is_err(), "the reader is gone");
}

#[test]
fn a_speed_beyond_the_limit_is_a_typing_error() {
    // The limit itself is allowed: what fails is the port.
    let spin = Process::start("spin --port /none --node 1 --rps -2 --max-rps 2");
    assert!(spin.complaint(1).contains("/none"));
    let (sim, port) = sim(TWO_NODES);
    let cases = [
        ("--rps 200", "--rps 200 is faster than --max-rps 20: raise the limit if you mean it"),
        ("--rps -20.5", "--rps -20.5 is faster than --max-rps 20"),
        ("--rps 2 --max-rps 1.5", "--rps 2 is faster than --max-rps 1.5"),
        ("--rps 2 --max-rps 0", "a limit must be above 0"),
        ("--rps 2 --max-rps NaN", "NaN is not a finite number"),
    ];
    for (args, expected) in cases {
        let spin = Process::start(&format!("spin --port {port} --node 1 {args}"));
        let complaint = spin.complaint(2);
        assert!(complaint.contains(expected), "{args} gives {complaint}");
    }
    let args = format!("spin --port {port} --node 1 --rps 30 --max-rps 30 --for 1.5");
    Process::start(&args).success();
    let commands = sim.lines_up_to("command 0.00 rps");
    let commands: Vec<_> = commands.iter().filter(|line| line.contains("command")).collect();
    assert!(commands[0].contains("command 30.00 rps"), "{commands:?}");
}
