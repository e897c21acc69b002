//! `axle stop`: stops whatever answers on a line.

use std::{
    fs, thread,
    time::{Duration, Instant},
};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        self, Mode, NodeId, Rps, Slave, Target, VelocityResponse, WriteRequest,
        board::ThreeMotors,
        slave::{SlaveConfig, SlaveEvent},
    },
    stream, time,
};
use serde_json::Value;

use super::{
    Process, TWO_NODES,
    played::{self, Node, PlayedLine, Said, confirmable_stops, parrot, speeds},
    record::{decoded, fresh},
    sim, wait_until,
};

#[test]
fn stop_finds_what_a_killed_program_has_left_turning_and_stops_it() {
    let (sim, port) = sim(TWO_NODES);
    for args in ["--node 1 --rps 3", "--node 3 --revolutions 1000"] {
        let spin = Process::start(&format!("spin --port {port} {args} --for 600"));
        let first = spin.line("node");
        assert!(first.contains("target "), "{first}");
        sim.line(if args.contains("rps") { "command 3.00 rps" } else { "command 1000.0000 turns" });
        spin.kill();
    }
    let lines = Process::start(&format!("stop --port {port}")).success();
    assert!(lines[0].starts_with("node 1: 0.0") && lines[0].ends_with("stopped and confirmed"));
    assert!(lines[1].starts_with("node 3: ") && lines[1].ends_with("turns, stopped and confirmed"));
    assert_eq!(lines[2..], ["silent, not stopped: 2, 4, 5, 6, 7, 8"]);
    sim.line("node 1: at rest");
    sim.line("node 3: at rest");
}

#[test]
fn stop_records_a_bus_that_is_silent_and_then_the_rover() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive -p {port} --speed 60 --turn 0 -f 600"));
    sim.line("moving");
    drive.kill();
    let path = fresh("stop.pcapng");
    Process::start(&format!("stop -p {port} --record {path}")).success();
    let (events, _) = decoded(&path);
    let is = |interface: u64, message: &str| {
        let found = |event: &Value| event["interface"] == interface && event["message"] == message;
        events.iter().any(found)
    };
    assert!(is(0, "read_request") && is(1, "motor_control") && is(1, "report"));
}

#[test]
fn a_recording_that_cannot_be_made_does_not_keep_a_motor_turning() {
    let line = played::bus(&[Node { rps: 2.0, ..Node::velocity(1) }], |_, _| {});
    let stop = format!("stop -p {} -P ikeya --record /dev/full", line.path);
    let error = Process::start(&stop).complaint(1);
    assert!(error.starts_with("cannot create \"/dev/full\": "), "{error}");
    assert_eq!(line.lock().nodes[0].rps, 0.0);
}

#[test]
fn on_a_line_with_echo_silent_ids_are_silent() {
    let (_sim, port) = sim("ikeya --node 1:velocity --echo");
    let lines = Process::start(&format!("stop -p {port} -P ikeya --echo")).success();
    assert_eq!(lines[1..], ["silent, not stopped: 2, 3, 4, 5, 6, 7, 8"]);
    let complaint = Process::start(&format!("stop -p {port} -P ikeya")).complaint(1);
    let hint = "; requests are heard: use --echo if the adapter hears itself, and stop any other \
                program on this line";
    assert!(complaint.ends_with(hint), "{complaint}");
}

#[test]
fn stop_sends_to_a_bus_nothing_but_reads_and_stops() {
    let nodes = [Node { rps: 2.0, ..Node::velocity(2) }, Node::position(7, -8192 * 3)];
    let line = played::bus(&nodes, |_, _| {});
    Process::start(&format!("stop --port {}", line.path)).success();
    let said = line.said();
    let is_hold = |said: &Said| matches!(said, Said::Write(7, _, to) if *to == -8192 * 3);
    for said in &said {
        let is_stop = matches!(said, Said::Write(2, 0.0, _)) || is_hold(said);
        assert!(is_stop || matches!(said, Said::Read(1..=8)), "{said:?}");
    }
    assert!(confirmable_stops(&said, 2) >= 2 && said.iter().filter(|it| is_hold(it)).count() >= 2);
    assert_eq!(line.lock().strays, 0);
    assert_eq!(line.lock().nodes[0].rps, 0.0);
}

#[test]
fn stop_of_one_node_leaves_the_others_alone_and_fails_if_that_node_is_silent() {
    let turning = |id| Node { rps: 2.0, ..Node::velocity(id) };
    let line = played::bus(&[turning(2), turning(7)], |_, _| {});
    let stop = |node| Process::start(&format!("stop -p {} -P ikeya -n {node}", line.path));
    let lines = stop(2).success();
    assert_eq!(lines, ["node 2: 0.00 rps, stopped and confirmed"]);
    let is_two = |said: &Said| matches!(said, Said::Read(2) | Said::Write(2, 0.0, _));
    assert!(line.said().iter().all(is_two), "{:?}", line.said());
    assert_eq!(line.lock().nodes[1].rps, 2.0);
    stop(3).complaint(1);
    assert_eq!(line.lock().nodes[1].rps, 2.0);
}

#[test]
fn stop_waits_until_the_motor_stands_still() {
    let node = Node { rps: 2.0, follows: false, ..Node::velocity(1) };
    let line = played::bus(&[node], |_, _| {});
    let stop = Process::start(&format!("stop --port {} --protocol ikeya", line.path));
    wait_until("the stops", || confirmable_stops(&line.said(), 1) >= 2);
    thread::sleep(Duration::from_millis(1500));
    assert!(stop.lines().is_empty(), "{:?}", stop.lines());
    line.change(|node| node.rps = 0.04);
    assert_eq!(stop.success()[0], "node 1: 0.04 rps, stopped and confirmed");
}

#[test]
fn stop_fails_when_a_node_never_confirms() {
    // It answers one READ, and then only receives.
    let line = played::bus(&[Node::velocity(1), Node::velocity(4)], |said, bus| {
        bus.nodes[0].is_dumb |= matches!(said, Said::Write(1, ..));
    });
    line.lock().nodes[1].rps = 2.0;
    let ended = Process::start(&format!("stop --port {}", line.path)).end();
    let expected = "axle: node 1 was told to stop and has not confirmed it (nothing received): it \
                    may be moving";
    assert_eq!((ended.code, &*ended.stderr), (Some(1), &[expected.to_owned()][..]));
    assert_eq!(ended.stdout[0], "node 4: 0.00 rps, stopped and confirmed");
    assert!(confirmable_stops(&line.said(), 1) >= 3, "{:?}", speeds(&line.said()));
}

#[test]
fn stop_fails_when_a_motor_turns_on() {
    let node = Node { rps: 2.0, follows: false, ..Node::velocity(1) };
    let line = played::bus(&[node], |_, _| {});
    let stop = format!("stop --port {} --protocol ikeya --node 1 --json", line.path);
    let ended = Process::start(&stop).end();
    let expected = "node 1 confirmed the stop, but is still moving after 2 s: 2.00 rps";
    assert_eq!((ended.code, &*ended.stderr), (Some(1), &[format!("axle: {expected}")][..]));
    let said: Vec<Value> =
        ended.stdout.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let outcome = serde_json::json!({"event": "outcome", "at_rest": false, "failure": expected});
    assert_eq!(said, [outcome]);
}

#[test]
fn a_motor_that_turns_on_is_the_outcome_and_a_recording_that_fails_is_told_before_it() {
    let node = Node { rps: 2.0, follows: false, ..Node::velocity(1) };
    let line = played::bus(&[node], |_, _| {});
    let stop = format!("stop -p {} -P ikeya -n 1 -j --record /dev/full", line.path);
    let ended = Process::start(&stop).end();
    let [recording, motor] = &ended.stderr[..] else { panic!("{ended:?}") };
    assert!(recording.starts_with("axle: cannot create \"/dev/full\": "), "{recording}");
    let turns_on = "node 1 confirmed the stop, but is still moving after 2 s: 2.00 rps";
    assert_eq!((ended.code, &**motor), (Some(1), &*format!("axle: {turns_on}")));
    let outcome: Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!((&outcome["at_rest"], &outcome["failure"]), (&false.into(), &turns_on.into()));
}

#[test]
fn a_single_node_has_to_answer_and_no_other_is_stopped() {
    let line = played::bus(&[Node { rps: 2.0, ..Node::velocity(4) }], |_, _| {});
    for protocol in ["", " --protocol ikeya"] {
        let stop = Process::start(&format!("stop --port {} --node 5{protocol}", line.path));
        assert_eq!(stop.complaint(1), "node 5 does not answer");
    }
    let said = line.said();
    assert!(said.len() >= 6 && said.iter().all(|said| *said == Said::Read(5)), "{said:?}");
    assert_eq!(line.lock().nodes[0].rps, 2.0);
}

#[test]
fn a_line_on_which_nothing_answers_is_no_stop() {
    let line = parrot(&[]);
    for (protocol, expected) in [
        ("", "no node answers on "),
        ("--protocol ikeya", "no node answers on "),
        ("--protocol ikeya-3", "no node answers on "),
        ("--protocol ucp", "no robot answers on "),
    ] {
        let stop = Process::start(&format!("stop --port {} {protocol}", line.path)).end();
        assert_eq!((stop.code, &*stop.stdout, stop.stderr.len()), (Some(1), &[][..], 1));
        let complaint = stop.stderr[0].strip_prefix("axle: ").unwrap();
        assert!(complaint.starts_with(expected), "{protocol}: {complaint}");
        assert_eq!(complaint.contains("no robot answers"), !protocol.contains("ikeya"));
    }
}

#[test]
fn a_node_with_only_damaged_answers_is_not_called_stopped() {
    let line = parrot(&[0x55, 0x01, 0x55, 0xAA, 0x00, 0xFF, 0x56, 0x03]);
    let stop = Process::start(&format!("stop --port {} --protocol ikeya --node 1", line.path));
    let expected = "id 1 gives only damaged answers: its motor may be moving";
    assert_eq!(stop.complaint(1), expected);
}

#[test]
fn a_stop_is_not_interrupted() {
    let node = Node { rps: 2.0, follows: false, ..Node::velocity(1) };
    let line = played::bus(&[node], |_, _| {});
    let stop = Process::start(&format!("stop --port {} --protocol ikeya", line.path));
    line.wait_for(Said::Write(1, 0.0, 0));
    for signal in ["INT", "TSTP", "QUIT", "TERM"] {
        stop.signal(signal);
        thread::sleep(Duration::from_millis(100));
    }
    // While nothing moves, a second one, a second later, ends a tool.
    thread::sleep(Duration::from_secs(1));
    stop.signal("INT");
    thread::sleep(Duration::from_millis(100));
    line.change(|node| node.rps = 0.0);
    assert_eq!(stop.success()[0], "node 1: 0.00 rps, stopped and confirmed");
}

#[test]
fn stop_finds_a_rover_with_and_without_its_protocol() {
    for protocol in ["", " --protocol ucp"] {
        let line = played::rover(Some([70, -70, 70, -70]));
        let stop = Process::start(&format!("stop --port {}{protocol}", line.path));
        wait_until("the stops", || line.lock().commands.len() >= 8);
        assert!(stop.lines().is_empty(), "its wheels are turning: {:?}", stop.lines());
        line.lock().wheels = None;
        let lines = stop.success();
        assert!(lines[0].contains("rpm    0    0    0    0") && lines[0].ends_with("stopped"));
        let rover = line.lock();
        assert!(rover.commands.iter().all(|command| *command == (0, 0)), "{:?}", rover.commands);
        assert_eq!(rover.strays > 0, protocol.is_empty(), "READ packets are sent first");
    }
}

#[test]
fn a_rover_that_turns_on_the_spot_is_not_called_stopped() {
    let line = played::rover(Some([70, -70, 70, -70]));
    let stop = Process::start(&format!("stop --port {} --protocol ucp", line.path));
    let complaint = stop.complaint(1);
    assert!(complaint.ends_with("but its wheels are still turning"), "{complaint}");
}

/// Node 3 with three motors that turn, and the speeds that it is told.
fn three_motors() -> PlayedLine<Vec<[f32; 3]>> {
    let start = Instant::now();
    let now = move || time::Instant::from_micros(start.elapsed().as_micros() as u64);
    let config = SlaveConfig::usb_adapter();
    let mut slave = Slave::<ThreeMotors>::for_board(NodeId::N3, Mode::Velocity, config, now());
    slave.set_velocity([Rps::new(2.0).unwrap(); 3]);
    PlayedLine::new(Vec::new(), move |told, bytes| {
        slave.handle_input(bytes, now());
        while let Some(event) = slave.poll_event() {
            if let SlaveEvent::Command(Target::Velocity(speeds)) = event {
                slave.set_velocity(speeds);
                told.lock().unwrap().push(speeds.map(Rps::get));
            }
        }
        slave.poll_transmit(now()).map(<[u8]>::to_vec).unwrap_or_default()
    })
}

#[test]
fn boards_with_three_motors_are_stopped_with_and_without_their_protocol() {
    for protocol in [" --protocol ikeya-3", ""] {
        let line = three_motors();
        let lines = Process::start(&format!("stop --port {}{protocol}", line.path)).success();
        assert_eq!(lines[0], "node 3: 0.00 0.00 0.00 rps, stopped and confirmed");
        let told = line.lock();
        assert!(told.len() >= 2 && told.iter().all(|speeds| *speeds == [0.0; 3]), "{told:?}");
    }
}

#[test]
fn boards_of_the_other_kind_are_named_with_their_protocol() {
    let three = three_motors();
    let (_sim, one) = sim("ikeya --node 1:velocity");
    for (path, asked, hint) in [
        (&*three.path, "ikeya", "; boards with three motors answer: use --protocol ikeya-3"),
        (&*one, "ikeya-3", "; boards with one motor answer: use --protocol ikeya"),
    ] {
        let complaint = Process::start(&format!("stop -p {path} -P {asked}")).complaint(1);
        assert!(complaint.ends_with(hint), "{complaint}");
    }
}

#[test]
fn a_stop_that_waits_sends_the_stop_again_to_a_node_that_is_back() {
    let line = played::bus(&[Node { rps: 2.0, ..Node::velocity(1) }], |said, bus| {
        // The first stop is lost, and the node is offline for a moment.
        if matches!(said, Said::Write(1, 0.0, _)) && speeds_said(bus) == 1 {
            (bus.nodes[0].is_dumb, bus.nodes[0].follows) = (true, false);
        }
    });
    let stop = Process::start(&format!("stop --port {} --protocol ikeya", line.path));
    wait_until("the first stop", || !speeds(&line.said()).is_empty());
    thread::sleep(Duration::from_millis(500));
    line.change(|node| (node.is_dumb, node.follows) = (false, true));
    assert_eq!(stop.success()[0], "node 1: 0.00 rps, stopped and confirmed");
    assert_eq!(line.lock().nodes[0].rps, 0.0);
}

fn speeds_said(bus: &played::BusState) -> usize {
    bus.said.iter().filter(|(said, _)| matches!(said, Said::Write(..))).count()
}

#[test]
fn on_a_line_with_jitter_no_motor_is_taken_for_a_silent_id() {
    for (delay, jitter, seed) in [(0.1, 0.05, 1), (0.05, 0.05, 3)] {
        let (_sim, port) = sim(&format!(
            "ikeya --node 1:velocity --node 6:velocity --node 8:velocity --delay {delay} \
             --jitter {jitter} --seed {seed}"
        ));
        // A pause inside a packet may cost it.
        for _ in 0..5 {
            for node in [NodeId::N1, NodeId::N6, NodeId::N8] {
                let turn = WriteRequest::velocity(node, Rps::new(2.0).unwrap());
                fs::write(&port, turn.as_bytes()).unwrap();
                thread::sleep(Duration::from_millis(100));
            }
        }
        let stop = Process::start(&format!("stop --port {port} --protocol ikeya")).end();
        let is_told = |node: u8| {
            let of = format!("node {node}");
            stop.stdout.iter().chain(&stop.stderr).any(|line| line.contains(&of))
        };
        assert!([1, 6, 8].into_iter().all(is_told), "{delay} {jitter} {seed}: {stop:?}");
        assert!(stop.code == Some(1) || stop.stdout.len() == 4, "{stop:?}");
    }
}

#[test]
fn a_stop_of_one_node_on_a_slow_line_leaves_the_others_alone() {
    let (sim, port) = sim("ikeya --node 1:velocity --node 3:velocity --delay 0.06");
    let spin = format!("spin -p {port} --node 1 --rps 2 --for 600 --reply-timeout 0.3");
    let spin = Process::start(&spin);
    sim.line("node 1: command 2.00 rps");
    // Answers of node 1 are still on their way.
    spin.kill();
    let stop = Process::start(&format!("stop -p {port} -P ikeya --node 3")).end();
    assert_eq!((stop.code, stop.stdout.len()), (Some(0), 1), "{stop:?}");
    assert!(stop.stdout[0].starts_with("node 3: "), "{stop:?}");
    let stop = Process::start(&format!("stop -p {port} -P ikeya --node 1")).end();
    sim.line("node 1: command 0.00 rps");
    assert!(stop.code == Some(0) && stop.stdout[0].starts_with("node 1: "), "{stop:?}");
}

/// Turning nodes that answer a READ after a time that depends on how often they were asked.
struct Turning {
    rps: [Rps; 8],
    asked: [u32; 8],
    due: Vec<(Instant, [u8; 8])>,
}

fn turning(after: impl Fn(NodeId, u32) -> Option<f64> + Send + 'static) -> PlayedLine<Turning> {
    let start = Turning { rps: [Rps::new(3.0).unwrap(); 8], asked: [0; 8], due: Vec::new() };
    let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
    PlayedLine::new(start, move |shared, mut bytes| {
        let Turning { rps, asked, due } = &mut *shared.lock().unwrap();
        while let Some(event) = decoder.decode(&mut bytes) {
            let stream::Event::Frame(request) = event else { continue };
            let (node, place) = (request.id(), usize::from(request.id().get()) - 1);
            match request {
                ikeya::Request::Write(write) => rps[place] = Rps::new(write.as_velocity()).unwrap(),
                ikeya::Request::Read(_) => {
                    asked[place] += 1;
                    let answer = *VelocityResponse::new(node, rps[place]).as_bytes();
                    let after = after(node, asked[place]).map(Duration::from_secs_f64);
                    due.extend(after.map(|after| (Instant::now() + after, answer)));
                }
            }
        }
        let now = Instant::now();
        due.extract_if(.., |(at, _)| *at <= now).flat_map(|(_, answer)| answer).collect()
    })
}

#[test]
fn a_node_that_has_answered_during_a_stop_is_at_rest_or_a_failure() {
    // Node 2 answers late, and node 1 once, very late.
    let line = turning(|node, asked| match node {
        NodeId::N2 => Some(0.1),
        NodeId::N1 => (asked == 1).then_some(0.9),
        _ => None,
    });
    let stop = Process::start(&format!("stop -p {} -P ikeya", line.path)).end();
    assert_eq!((stop.code, stop.stdout.len()), (Some(1), 2), "{stop:?}");
    let complaint = stop.stderr.last().unwrap();
    assert!(complaint.contains("id 1 gives only answers that are too late"), "{stop:?}");
    // Node 8 answers its last READ alone.
    let line = turning(|node, asked| match node {
        NodeId::N1 => Some(0.2),
        NodeId::N8 => (asked >= 4).then_some(0.2),
        _ => None,
    });
    let stop = Process::start(&format!("stop -p {} -P ikeya", line.path)).end();
    let is_at_rest = line.lock().rps[7] == Rps::ZERO;
    assert!(stop.code == Some(1) || is_at_rest, "{stop:?}");
    assert!(stop.stdout.iter().any(|line| line.starts_with("node 8: ")), "{stop:?}");
}

#[test]
fn nodes_that_answer_do_not_turn_on_while_another_one_is_waited_for() {
    // All answer late. Node 3 does so once, and is then silent.
    let line = turning(|node, asked| (node != NodeId::N3 || asked == 1).then_some(0.04));
    let stop = Process::start(&format!("stop -p {} -P ikeya", line.path));
    let begin = Instant::now();
    let are_stopped = || {
        let rps = line.lock().rps;
        NodeId::ALL.iter().zip(rps).all(|(node, rps)| *node == NodeId::N3 || rps == Rps::ZERO)
    };
    wait_until("the stops of seven nodes", are_stopped);
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    stop.kill();
}

#[test]
fn a_node_whose_answers_come_late_after_one_in_time_is_stopped_all_the_same() {
    let line =
        turning(|node, asked| (node == NodeId::N5).then_some(if asked == 1 { 0.0 } else { 0.06 }));
    let stop = Process::start(&format!("stop -p {} -P ikeya", line.path)).end();
    assert_eq!(stop.code, Some(0), "{stop:?}");
    assert_eq!(stop.stdout[0], "node 5: 0.00 rps, stopped and confirmed");
    assert!(stop.stderr[0].contains("--reply-timeout network"), "{stop:?}");
}
