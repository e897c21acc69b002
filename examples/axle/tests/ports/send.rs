//! `axle send`: single messages; what they move is stopped.

use std::{thread, time::Duration};

use axlewire::ikeya::{Mode, Position};

use super::{
    Process, TWO_NODES,
    played::{self, Node, Said, confirmable_stops, speeds},
    sim, wait_until,
};

/// The error line of a run that sends no command to anybody.
fn refused(nodes: &[Node], message: &str) -> String {
    let line = played::bus(nodes, |_, _| {});
    let error = Process::start(&format!("send --port {} {message}", line.path)).complaint(1);
    let is_write = |said: &Said| matches!(said, Said::Write(..));
    assert!(!line.said().iter().any(is_write), "{message}: {:?}", line.said());
    error
}

#[test]
fn a_question_and_its_answer_are_listed() {
    let (_sim, port) = sim(TWO_NODES);
    let lines = Process::start(&format!("send -p {port} ikeya read 3")).success();
    assert!(lines[1].contains("  out           0      4  read_request               3"));
    assert!(lines[2].contains("  in            0      8  position_response          3"));
    assert_eq!(lines.len(), 3, "{lines:?}");
    let json = Process::start(&format!("send -p {port} --json ikeya hex AA01 BED0")).success();
    assert!(json[0].contains(r#""direction":"out","length":4,"#), "{json:?}");
    assert!(json[1].contains(r#""message":"velocity_response","node":1,"rps":0.0"#));
}

#[test]
fn a_motor_that_is_commanded_is_stopped_at_the_end() {
    let (sim, port) = sim(TWO_NODES);
    let lines = Process::start(&format!("send -p {port} --for 0.3 ikeya velocity 1 2.5")).success();
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    sim.line("node 1: command 2.50 rps");
    sim.line("node 1: command 0.00 rps");
    Process::start(&format!("send -p {port} --for 1 ikeya position 3 -0.5")).success();
    sim.line("node 3: at rest at -0.5000 turns");
    let json = Process::start(&format!("send -p {port} -j -f 0 ikeya velocity 1 1")).success();
    assert_eq!(json.last().unwrap(), r#"{"event":"stopped","node":1}"#);
}

#[test]
fn a_signal_or_a_lost_port_stops_what_was_commanded() {
    let (sim, port) = sim(TWO_NODES);
    for (signal, rps) in [("INT", "3.00"), ("TERM", "4.00"), ("USR1", "5.00")] {
        let send = format!("send -p {port} --for 600 ikeya velocity 1 {rps}");
        let send = Process::start(&send);
        sim.line(&format!("node 1: command {rps} rps"));
        // The node can have heard the command before the tool knows that it has left.
        send.line("write");
        send.signal(signal);
        let lines = send.success();
        assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    }
    let send = Process::start(&format!("send -p {port} --for 600 ikeya velocity 1 6"));
    sim.line("node 1: command 6.00 rps");
    sim.kill();
    let error = send.complaint(1);
    assert!(error.contains("disconnected"), "{error}");
    assert!(error.contains("; node 1 was told to stop and has not confirmed it"), "{error}");
    assert!(error.ends_with(": it may be moving"), "{error}");
}

#[test]
fn a_command_for_the_other_mode_reaches_nobody() {
    let error = refused(&[Node::position(3, 0)], "ikeya velocity 3 1");
    assert_eq!(error, "node 3 is in position mode, but a command is for velocity mode");
    let error = refused(&[Node::velocity(1)], "ikeya position 1 1");
    assert_eq!(error, "node 1 is in velocity mode, but a command is for position mode");
    // 1.0 rps as hex digits, to a node that would take it for 16,256 turns.
    let error = refused(&[Node::position(1, 0)], "ikeya hex BB010000803F0740");
    assert!(error.starts_with("16256.0000 turns for node 1, which is at 0.0000"), "{error}");
}

#[test]
fn what_is_too_fast_or_too_far_or_without_a_node_reaches_nobody() {
    let error = refused(&[Node::velocity(1)], "ikeya velocity 1 20.5");
    assert!(error.starts_with("20.5 rps for node 1 is more than --max-rps 20"), "{error}");
    let error = refused(&[Node::velocity(1)], "--max-rps 1 ikeya velocity 1 -1.5");
    assert!(error.starts_with("-1.5 rps for node 1 is more than --max-rps 1"), "{error}");
    let far = format!("ikeya position 3 {}", Position::new(0, 101).revolutions());
    let error = refused(&[Node::position(3, 0)], &far);
    assert!(error.contains("is farther than --max-turns 100"), "{error}");
    let error = refused(&[Node::velocity(1)], "ikeya velocity 2 1");
    assert_eq!(error, "node 2 does not answer: without its mode, nothing is sent to it");
}

#[test]
fn a_rover_that_is_commanded_is_stopped_at_the_end() {
    let (sim, port) = sim("ucp");
    let lines =
        Process::start(&format!("send -p {port} --count 5 ucp motor 40 -10 --lamp")).success();
    assert!(lines.last().unwrap().ends_with(", stopped"), "{lines:?}");
    sim.line("command: speed 40 %, turn 10 % left, lamp on");
    sim.line("at rest after");
    let zero = Process::start(&format!("send -p {port} --for 0.1 ucp motor 0 0")).success();
    assert!(zero.last().unwrap().ends_with(", stopped"), "{zero:?}");
}

#[test]
fn a_rover_that_turns_on_is_not_said_to_be_stopped_and_one_that_is_not_heard_gets_no_command() {
    let line = played::rover(Some([0, 0, 5, 0]));
    let send = format!("send -p {} -f 0.1 ucp motor 40 0", line.path);
    let error = Process::start(&send).complaint(1);
    assert!(error.ends_with("to stop, but its wheels are still turning"), "{error}");
    let silent = played::parrot(&[]);
    let error = Process::start(&send.replace(&line.path, &silent.path)).complaint(1);
    assert!(error.starts_with("no robot answers on "), "{error}");
    let is_zero = |frame: &[u8]| frame[..5] != [0xFD, 0xFF, 20, 0, 2] || frame[6..10] == [0; 4];
    assert!(silent.lock().windows(24).all(is_zero), "{:02x?}", silent.lock());
}

#[test]
fn a_board_with_three_motors_is_commanded_and_stopped() {
    let (sim, port) = sim("ikeya-3 --node 1:velocity --node 3:position");
    let send = format!("send -p {port} -f 0.3 ikeya-3 velocity 1 1 -2 3");
    let lines = Process::start(&send).success();
    assert!(lines.last().unwrap().ends_with("rps, stopped and confirmed"), "{lines:?}");
    sim.line("node 1: command 1.00 -2.00 3.00 rps");
    sim.line("node 1: command 0.00 0.00 0.00 rps");
    let send = format!("send -p {port} ikeya-3 position 3 0 101 0");
    let error = Process::start(&send).complaint(1);
    assert!(error.starts_with("101.0000 turns for node 3, which is at 0.0000"), "{error}");
}

#[test]
fn messages_of_a_host_are_answered_by_a_robot() {
    let (sim, port) = sim("ucp");
    let pairs = [
        ("ping", "pong"),
        ("calibration-start imu", "calibration_start_ack"),
        ("calibration-end imu", "calibration_end_ack"),
    ];
    for (message, answer) in pairs {
        let lines = Process::start(&format!("send -p {port} ucp {message}")).success();
        assert!(lines.iter().any(|line| line.contains(answer)), "{message}: {lines:?}");
    }
    Process::start(&format!("send -p {port} ucp network-state connected")).success();
    sim.line("network state: connected");
}

#[test]
fn what_harms_a_robot_is_refused_before_the_port_is_opened() {
    let frames = [
        // version 39, id 9, a report.
        ("FDFF140002000000000000000000270000000000000000000000", "not one whole frame"),
        ("FDFF060009000100", "not one whole frame"),
        ("FDFF0400050086 41", "not one whole frame"),
    ];
    for (hex, why) in frames {
        let error = Process::start(&format!("send -p /dev/none ucp hex {hex}")).complaint(2);
        assert!(error.contains(why), "{hex}: {error}");
    }
    let mut update = vec![0xFD, 0xFF, 20, 0, 2, 0];
    update.extend([0; 16]);
    update[14] = 39;
    update.extend(axlewire::crc16::compute(&update).to_le_bytes());
    let hex: String = update.iter().map(|byte| format!("{byte:02x}")).collect();
    let error = Process::start(&format!("send -p /dev/none ucp hex {hex}")).complaint(2);
    assert_eq!(error, "nothing is sent: a motor command that starts a firmware update (ruling U7)");
}

#[test]
fn frames_of_a_device_are_sent_only_as_a_device() {
    let line = played::rover(None);
    let mut report = vec![0xFD, 0xFF, 40, 0, 5, 0];
    report.extend([0; 36]);
    report.extend(axlewire::crc16::compute(&report).to_le_bytes());
    let hex: String = report.iter().map(|byte| format!("{byte:02x}")).collect();
    let send = format!("send -p {} ucp hex {hex}", line.path);
    let error = Process::start(&send).complaint(2);
    assert_eq!(error, "nothing is sent: the frame is one of a device, see --as");
    assert_eq!(line.lock().bytes, 0);
    let lines = Process::start(&send.replace(" ucp", " --as device ucp")).success();
    assert!(lines.iter().any(|line| line.contains("out") && line.contains("report")));
    assert!(line.lock().commands.is_empty(), "a device stops nobody");
}

#[test]
fn a_robot_is_told_to_stop_before_and_between_frames_that_would_keep_it_driving() {
    let line = played::rover(None);
    Process::start(&format!("send -p {} -c 10 --every 0.05 -f 0 ucp ping", line.path)).success();
    let commands = line.lock().commands.clone();
    assert!((4..=6).contains(&commands.len()), "one every 0.1 s: {commands:?}");
    assert!(commands.iter().all(|&command| command == (0, 0)), "{commands:?}");
    // One of the user's leaves once the robot is heard, and is repeated until it stands still.
    let line = played::rover(None);
    Process::start(&format!("send -p {} -c 3 -f 0 ucp motor 0 0 --lamp", line.path)).success();
    let lamps = line.lock().lamps.clone();
    let first = lamps.iter().position(|lamp| *lamp == 100).unwrap();
    assert!(first <= 2 && lamps[first..].iter().all(|lamp| *lamp == 100), "{lamps:?}");
}

#[test]
fn frames_are_sent_no_faster_than_the_line_carries_them() {
    let line = played::bus(&[], |_, _| {});
    // 40 bytes of 10 bits at 9600 bit/s.
    let send = format!("send -p {} -b 9600 -c 10 --every 0 -f 0 ikeya read 1", line.path);
    Process::start(&send).success();
    let at: Vec<_> = line.lock().said.iter().map(|(_, at)| *at).collect();
    let span = *at.last().unwrap() - at[0];
    assert!(at.len() == 10 && span >= Duration::from_millis(35), "{span:?}");
}

#[test]
fn what_follows_a_question_waits_for_the_answer() {
    let line = played::bus(&[], |_, _| {});
    // 4 bytes, and 8 of the answer, of 10 bits at 9600 bit/s.
    let send = format!("send -p {} -b 9600 -c 5 --every 0 -f 0 ikeya read 1", line.path);
    Process::start(&send).success();
    let at: Vec<_> = line.lock().said.iter().map(|(_, at)| *at).collect();
    let span = *at.last().unwrap() - at[0];
    assert!(at.len() == 5 && span >= Duration::from_millis(48), "{span:?}");
}

#[test]
fn what_was_due_while_the_tool_was_suspended_is_not_sent() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let args = format!("send -p {} -c 1000 --every 0.02 ikeya velocity 1 2", line.path);
    let send = Process::start(&args);
    wait_until("a command", || speeds(&line.said()).contains(&2.0));
    send.signal("STOP");
    wait_until("a suspension", || send.state() == 'T');
    thread::sleep(Duration::from_secs(1));
    let before = line.said().len();
    send.signal("CONT");
    let error = send.complaint(1);
    assert!(error.starts_with("the tool did not run for 1."), "{error}");
    assert!(error.ends_with("; what was commanded is stopped and at rest"), "{error}");
    assert!(!speeds(&line.said()[before..]).contains(&2.0), "{:?}", &line.said()[before..]);
}

#[test]
fn frames_that_a_signal_keeps_from_being_sent_are_counted() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let args = format!("send -p {} -c 1000 --every 10 ikeya velocity 1 2", line.path);
    let send = Process::start(&args);
    wait_until("a command and a READ", || {
        let said = line.said();
        said.iter().rposition(|said| *said == Said::Read(1))
            > said.iter().position(|said| matches!(said, Said::Write(..)))
            && speeds(&said).contains(&2.0)
    });
    send.signal("INT");
    let error = send.complaint(1);
    let expected = "999 frames not sent: interrupted; what was commanded is stopped and \
                    at rest";
    assert_eq!(error, expected);
}

#[test]
fn a_node_that_hears_but_is_not_heard_any_more_is_stopped() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        bus.nodes[0].is_dumb |= matches!(said, Said::Write(..));
    });
    let args = format!("send -p {} -f 0.2 ikeya velocity 1 5", line.path);
    let error = Process::start(&args).complaint(1);
    assert_eq!(
        error,
        "node 1 was told to stop and has not confirmed it (nothing received): it may be moving"
    );
    assert_eq!(line.lock().nodes[0].rps, 0.0);
}

#[test]
fn a_node_that_turns_to_position_mode_is_held_where_it_is_even_if_its_answers_are_lost() {
    for lost in [0, 20] {
        let (mut writes, mut mute) = (0, 0);
        let line = played::bus(&[Node::velocity(1)], move |said, bus| match said {
            Said::Write(..) => {
                writes += 1;
                if writes == 2 {
                    bus.nodes[0] = Node { follows: false, ..Node::position(1, 4096) };
                }
            }
            // Its first answer in the new mode is heard, the next are not.
            Said::Read(_) if bus.nodes[0].mode == Mode::Position => {
                bus.nodes[0].is_dumb = (1..=lost).contains(&mute);
                mute += 1;
            }
            Said::Read(_) => {}
        });
        let args = format!("send -p {} -c 20 --every 0.05 ikeya velocity 1 1", line.path);
        let error = Process::start(&args).complaint(1);
        assert!(error.contains("node 1 "), "{error}");
        let said = line.said();
        let turned = speeds(&said).iter().position(|&rps| rps == 1.0).unwrap() + 2;
        let holds = said.iter().filter(|said| matches!(said, Said::Write(_, _, 4096)));
        assert!(lost > 0 || holds.count() > 0, "{said:?}");
        for said in said.iter().filter(|said| matches!(said, Said::Write(..))).skip(turned) {
            assert!(matches!(said, Said::Write(_, _, 4096)), "{lost}: {said:?}");
        }
    }
}

#[test]
fn an_echo_is_not_taken_for_what_others_say() {
    let (_sim, port) = sim("ikeya --node 1:velocity --echo");
    let lines = Process::start(&format!("send -p {port} --echo ikeya read 1")).success();
    let names: Vec<_> =
        lines[1..].iter().filter_map(|line| line.split_whitespace().nth(4)).collect();
    assert_eq!(names, ["read_request", "velocity_response"], "{lines:?}");
}

#[test]
fn wrong_words_are_usage_errors() {
    let cases = [
        ("ikeya velocity 9 1", "9"),
        ("ikeya velocity 1 nan", "nan"),
        ("ikeya velocity 1 1 2 3", "a board with one motor takes one speed"),
        ("ikeya-3 velocity 1 1", "a board with three motors takes three speeds"),
        ("ikeya hex AA0", "not an even number of hex digits"),
        ("ucp motor 101 0", "101 is not in -100..=100"),
        ("ucp biases 1 2 3", "9 values required"),
    ];
    for (message, expected) in cases {
        let error = Process::start(&format!("send -p /dev/none {message}")).complaint(2);
        assert!(error.contains(expected), "{message}: {error}");
    }
}

#[test]
fn a_stop_is_repeated_until_it_is_confirmed() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    Process::start(&format!("send -p {} --for 0.1 ikeya velocity 1 2", line.path)).success();
    let said = line.said();
    let mut speeds = speeds(&said);
    speeds.dedup();
    assert_eq!(speeds, [2.0, 0.0], "{said:?}");
    assert!(confirmable_stops(&said, 1) >= 2, "{said:?}");
}
