//! `axle replay`: a capture is sent again; what it moves is stopped.

use axlewire::{
    crc16,
    ikeya::{NodeId, ReadRequest, Rps, VelocityResponse, WriteRequest},
    ucp::{Body, MotorControl, message::Ping},
};

use serde_json::Value;

use super::{
    Process, TWO_NODES,
    played::{self, Node, Said, speeds},
    record::{decoded, fresh},
    sim,
    support::{
        file,
        pcapng::{Packet, PcapNg},
    },
};

/// A capture of a master that turns node 1 at these speeds, every 50 ms.
fn capture(speeds: &[f32], mode_is_known: bool) -> String {
    let node = NodeId::N1;
    let write = |rps: f32| *WriteRequest::velocity(node, Rps::new(rps).unwrap()).as_bytes();
    let writes: Vec<_> = speeds.iter().map(|&rps| write(rps)).collect();
    let answer = *VelocityResponse::new(node, Rps::ZERO).as_bytes();
    let mut packets = Vec::new();
    for (at, write) in writes.iter().enumerate() {
        packets.push((1_000_000 + at as u64 * 50_000, 2, &write[..]));
    }
    if mode_is_known {
        packets.push((2_000_000, 1, &answer[..]));
    }
    let path = fresh("replay.pcapng");
    let name = path.rsplit('/').next().unwrap();
    file(name, &PcapNg::new(147, &packets).0);
    path
}

#[test]
fn a_dry_run_lists_what_would_be_sent_and_when_and_needs_no_port_and_no_permission_to_move() {
    let path = capture(&[2.0, -2.0, 0.0], true);
    let lines = Process::start(&format!("replay {path} --dry-run --speed 0.5 --json")).success();
    let mut lines: Vec<Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let summary = lines.pop().unwrap();
    assert_eq!(
        (&summary["event"], &summary["sent"], &summary["left"]),
        (&"summary".into(), &0.into(), &3.into())
    );
    let listed: Vec<_> = lines
        .iter()
        .map(|line| (line["t"].as_f64().unwrap(), line["rps"].as_f64().unwrap()))
        .collect();
    assert_eq!(listed, [(0.0, 2.0), (0.1, -2.0), (0.2, 0.0)]);
    assert!(lines.iter().all(|line| line["direction"] == "out"), "{lines:?}");
    let without = format!("replay {path} --move");
    assert!(Process::start(&without).complaint(2).contains("--port"));
}

#[test]
fn a_recording_is_sent_again_and_what_it_moves_is_stopped() {
    let (sim, port) = sim(TWO_NODES);
    let path = fresh("spin.pcapng");
    Process::start(&format!("spin -p {port} --node 1 --rps 2 --for 0.6 --record {path}")).end();
    let again = fresh("again.pcapng");
    let replay = format!("replay {path} -p {port} --move --record {again}");
    let lines = Process::start(&replay).success();
    let [.., stopped, summary] = &lines[..] else { panic!("{lines:?}") };
    assert!(stopped.ends_with("stopped and confirmed"), "{stopped}");
    assert!(summary.contains(" frames sent, at most "), "{summary}");
    assert!(summary.contains(" frames of the other side, which answers"), "{summary}");
    let commands = |path: &str| -> Vec<_> {
        let (events, _) = decoded(path);
        let sent = events.into_iter().filter(|event| event["message"] == "write");
        let mut sent: Vec<_> = sent.map(|event| event["bytes"].clone()).collect();
        // Masters repeat their commands.
        sent.dedup();
        sent
    };
    assert_eq!(commands(&again), commands(&path));
    let turning = sim.lines().iter().filter(|line| line.ends_with("command 2.00 rps")).count();
    assert_eq!(turning, 2);
}

#[test]
fn commands_need_to_be_meant() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let path = capture(&[1.0, 2.0], true);
    let error = Process::start(&format!("replay {path} -p {}", line.path)).complaint(1);
    let expected = "2 of 2 frames move something: use --move if you mean it; nothing is sent";
    assert_eq!(error, expected);
    assert!(line.said().is_empty());
}

#[test]
fn a_node_in_another_mode_than_in_the_capture_gets_nothing() {
    for (known, expected) in [
        (true, "node 1 is in position mode, but a command is for velocity mode"),
        (false, "16256.0000 turns for node 1, which is at 0.0000, is farther than --max-turns"),
    ] {
        let line = played::bus(&[Node::position(1, 0)], |_, _| {});
        let path = capture(&[1.0], known);
        let replay = Process::start(&format!("replay {path} --move -p {}", line.path));
        let error = replay.complaint(1);
        assert!(error.starts_with(expected), "{error}");
        assert!(speeds(&line.said()).is_empty());
    }
}

#[test]
fn a_node_that_changes_its_mode_ends_the_replay_and_is_stopped_in_its_new_mode() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        if said == Said::Write(1, 1.0, 133_169_152) {
            bus.nodes[0] = Node { follows: false, ..Node::position(1, 4096) };
        }
    });
    let node = NodeId::N1;
    let write = *WriteRequest::velocity(node, Rps::new(1.0).unwrap()).as_bytes();
    let read = *ReadRequest::new(node).as_bytes();
    let answer = *VelocityResponse::new(node, Rps::ZERO).as_bytes();
    let packets: [Packet<'_>; 4] =
        [(0, 1, &answer), (10, 2, &write), (90_000, 2, &read), (5_000_000, 2, &write)];
    let path = file("turncoat.pcapng", &PcapNg::new(147, &packets).0);
    let replay = format!("replay {} --move -p {}", path.to_str().unwrap(), line.path);
    let error = Process::start(&replay).complaint(1);
    assert!(error.starts_with("node 1 has changed to position mode: "), "{error}");
    let said = line.said();
    let first = said.iter().position(|said| matches!(said, Said::Write(..))).unwrap();
    let later = &said[first + 1..];
    // It is held where it is.
    assert!(later.iter().any(|said| matches!(said, Said::Write(1, _, 4096))), "{later:?}");
    assert!(!later.contains(&said[first]), "{later:?}");
}

#[test]
fn pongs_of_the_capture_do_not_tell_that_the_stop_was_heard() {
    let (sim, port) = sim("ucp --delay 0.4");
    let ping = Ping {}.frame(0);
    let drive = MotorControl::new(60, 0).unwrap().frame(0);
    let mut packets: Vec<Packet<'_>> =
        (0..100).map(|at| (at * 20_000, 2, ping.as_bytes())).collect();
    packets.push((2_000_000, 2, drive.as_bytes()));
    let path = file("pings.pcapng", &PcapNg::new(150, &packets).0);
    let replay = format!("replay {} --move -p {port}", path.to_str().unwrap());
    Process::start(&replay).success();
    // No wait: the rover is at rest already.
    let lines = sim.lines();
    assert!(lines.iter().any(|line| line.ends_with("  moving")), "{lines:?}");
    assert!(lines.iter().any(|line| line.contains("at rest after")), "{lines:?}");
}

/// Shipped robots give the first frame up at its id, read past the header of the second one, and
/// take the update that it holds.
#[test]
fn a_frame_hidden_in_another_one_is_not_sent() {
    let unknown = [0xFD, 0xFF, 0x09, 0x00, 0x20, 0x01, 0, 0, 0, 0, 0, 0x41, 0xFB];
    let update = [0xFD, 0xFF, 0x06, 0x00, 0x09, 0x00, 0x28, 0x00, 0x9C, 0x23];
    let biases = [&[0xFD, 0xFF, 0x17, 0x00, 0x08, 0x00], &update[..], &[0; 9], &[0xAD, 0xC4]];
    let path = file("hidden.bin", &[&unknown[..], &biases.concat()].concat());
    let replay = format!("replay {} --protocol ucp -p /nowhere", path.to_str().unwrap());
    let error = Process::start(&replay).complaint(1);
    let expected = "another frame is hidden in frame 2, and a shipped robot may take it (ruling \
                    U13): nothing is sent";
    assert_eq!(error, expected);
    let hex: String = biases.concat().iter().map(|byte| format!(" {byte:02X}")).collect();
    let error = Process::start(&format!("send -p /nowhere ucp hex{hex}")).complaint(1);
    assert!(error.starts_with("another frame is hidden in frame 1, "), "{error}");
}

#[test]
fn a_hidden_frame_is_one_in_the_answers_of_a_device_too_and_none_in_a_command_to_a_role() {
    let update = [0xFD, 0xFF, 0x06, 0x00, 0x09, 0x00, 0x28, 0x00, 0x9C, 0x23];
    let sealed = |begin: &[u8]| {
        let frame = [begin, &update, &[0; 2]].concat();
        [&frame[..], &crc16::compute(&frame).to_le_bytes()].concat()
    };
    let (result, write) = (sealed(&[0xFD, 0xFF, 16, 0, 6, 0]), sealed(&[0xBB, 0x01]));
    for (bytes, options, expected) in [
        (&result, "--protocol ucp --as device", "another frame is hidden in frame 1, and a "),
        (&write, "--protocol ikeya-3 --move", "cannot use port \"/nowhere\""),
    ] {
        let path = file("no_robot.bin", bytes);
        let replay = format!("replay {} {options} -p /nowhere", path.to_str().unwrap());
        let error = Process::start(&replay).complaint(1);
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn behind_a_clock_that_was_set_the_pace_is_that_of_the_capture_and_it_is_said() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    let second = 1_000_000;
    let times = [5000 * second, 5001 * second, 20 * second, 21 * second];
    let packets = times.map(|at| (at, 2, &read[..]));
    let path = file("set_back.pcapng", &PcapNg::new(147, &packets).0);
    let replay = format!("replay {} -p {}", path.to_str().unwrap(), line.path);
    let ended = Process::start(&replay).end();
    let says = "axle: the clock of the capture goes back 1 time, by up to 1h 23m 1s";
    assert!(ended.code == Some(0) && ended.stderr[0].starts_with(says), "{ended:?}");
    let at: Vec<f64> = ended
        .stdout
        .iter()
        .filter(|line| line.contains("read_request"))
        .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(at.len(), 4, "{ended:?}");
    assert!(at.windows(2).all(|two| two[1] >= two[0]) && at[3] - at[0] > 1.9, "{at:?}");
}

#[test]
fn the_pace_is_that_of_the_capture_or_faster() {
    let speeds = [1_u8, 2, 3, 4, 5, 6, 7, 8, 9].map(f32::from);
    let path = capture(&speeds, true);
    for (factor, least_ms) in [(1, 400), (4, 100)] {
        let line = played::bus(&[Node::velocity(1)], |_, _| {});
        let replay = format!("replay {path} --move --speed {factor} -p {}", line.path);
        Process::start(&replay).success();
        let bus = line.lock();
        let is_of = |said: &Said, rps| matches!(said, Said::Write(1, it, _) if *it == rps);
        let first = |rps| bus.said.iter().find(|(said, _)| is_of(said, rps)).unwrap().1;
        let at = speeds.map(first);
        let took = (at[8] - at[0]).as_millis();
        assert!((least_ms - 20..3 * least_ms).contains(&took), "{took} ms");
    }
}

#[test]
fn the_other_side_of_a_capture_moves_nothing() {
    let line = played::parrot(&[]);
    let path = capture(&[1.0], true);
    let lines = Process::start(&format!("replay {path} --as device -p {}", line.path)).success();
    assert!(lines[1].contains("velocity_response"), "{lines:?}");
    let answer = VelocityResponse::new(NodeId::N1, Rps::ZERO);
    assert_eq!(*line.lock(), answer.as_bytes());
}

#[test]
fn raw_bytes_need_a_protocol_and_have_an_even_pace() {
    let bytes = ReadRequest::new(NodeId::N1).as_bytes().repeat(3);
    let path = file("reads.bin", &bytes);
    let path = path.to_str().unwrap();
    let error = Process::start(&format!("replay {path} -p /dev/none")).complaint(2);
    assert_eq!(error, "--protocol is needed for a capture of raw bytes");
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let replay = format!("replay {path} -P ikeya --every 0.05 -p {}", line.path);
    Process::start(&replay).success();
    assert_eq!(line.said(), [Said::Read(1); 3]);
}

/// A capture that is written to a file of its own.
fn captured(link_type: u16, packets: &[Packet<'_>]) -> String {
    let path = fresh("captured.pcapng");
    file(path.rsplit('/').next().unwrap(), &PcapNg::new(link_type, packets).0);
    path
}

#[test]
fn on_a_slow_line_the_last_command_leaves_too_and_the_summary_tells_how_late_they_were() {
    let write =
        |rps: u8| *WriteRequest::velocity(NodeId::N1, Rps::new(f32::from(rps)).unwrap()).as_bytes();
    let writes: Vec<_> = (1..=5).map(write).collect();
    let packets: Vec<Packet<'_>> =
        writes.iter().enumerate().map(|(at, it)| (1 + at as u64 * 300_000, 2, &it[..])).collect();
    let path = captured(147, &packets);
    let (sim, port) = sim("ikeya --node 1:velocity --delay 0.1");
    let replay = format!("replay {path} -p {port} --move --reply-timeout 0.4");
    let lines = Process::start(&replay).success();
    let summary = lines.last().unwrap();
    let late = summary.strip_prefix("5 frames sent, at most ").unwrap().split_once(' ').unwrap().0;
    assert!(late.parse::<f64>().unwrap() > 20.0, "{summary}");
    sim.line("command 5.00 rps");
    sim.line("at rest");
}

#[test]
fn commands_of_a_rover_that_follow_each_other_closely_are_all_sent() {
    let frames: Vec<_> = (10..20)
        .map(|speed| MotorControl::new(speed, 0).unwrap().frame(speed as u8).as_bytes().to_vec())
        .collect();
    let packets: Vec<Packet<'_>> =
        frames.iter().enumerate().map(|(at, it)| (1 + at as u64 * 5_000, 2, &it[..])).collect();
    let path = captured(150, &packets);
    let (_sim, port) = sim("ucp");
    let again = fresh("closely.pcapng");
    let replay = format!("replay {path} -p {port} --move --record {again}");
    let lines = Process::start(&replay).success();
    assert!(lines.last().unwrap().starts_with("10 frames sent"), "{lines:?}");
    let (events, _) = decoded(&again);
    let mut speeds: Vec<_> = events
        .iter()
        .filter(|event| event["message"] == "motor_control")
        .map(|event| event["speed"].as_i64().unwrap())
        .collect();
    speeds.dedup();
    assert_eq!(speeds, [&[0][..], &(10..20).collect::<Vec<_>>(), &[0]].concat());
}

#[test]
fn reads_of_a_node_that_does_not_answer_are_left_out_and_told() {
    let write = *WriteRequest::velocity(NodeId::N1, Rps::new(1.0).unwrap()).as_bytes();
    let read = *ReadRequest::new(NodeId::N2).as_bytes();
    let packets: [Packet<'_>; 3] = [(1, 2, &write), (100_001, 2, &read), (200_001, 2, &read)];
    let path = captured(147, &packets);
    let (_sim, port) = sim("ikeya --node 1:velocity");
    let lines = Process::start(&format!("replay {path} -p {port} --move")).success();
    let summary = lines.last().unwrap();
    assert!(summary.starts_with("1 frame sent"), "{summary}");
    assert!(summary.contains("2 READs left out: the node does not answer"), "{summary}");
}
