//! `axle drive`: drives a rover, and stops it before the tool exits.

use std::{
    io::Write,
    thread,
    time::{Duration, Instant},
};

use axlewire::{
    stream::Event,
    ucp::{
        self, Body, Message, Telemetry,
        message::{ErrorCode, FirmwareReport, Ping, Pong},
    },
};

use super::{
    Process,
    played::{self, PlayedLine, parrot},
    sim, wait_until,
};

#[test]
fn drive_moves_the_rover_and_stops_it_at_the_end() {
    let (sim, port) = sim("ucp --noise 1e-5");
    let lines =
        Process::start(&format!("drive --port {port} --speed 50 --turn 20 --for 1")).success();
    assert!(lines[0].ends_with("target: speed 50 %, turn 20 % right"), "{lines:?}");
    let (stopped, driving) = lines[1..].split_last().unwrap();
    let last = driving.last().unwrap();
    let rpm = |line: &str| -> Vec<i32> {
        line.split_whitespace().skip(3).take(4).map(|word| word.parse().unwrap()).collect()
    };
    let (left, right) = (rpm(last)[0], rpm(last)[1]);
    assert!(left > right && right > 0, "to the right, the left wheels are faster: {last}");
    assert!(rpm(stopped).iter().all(|rpm| rpm.abs() <= 2) && stopped.ends_with("stopped"));

    sim.line("command: speed 50 %, turn 20 % right");
    sim.line("command: speed 0 %, turn 0 %");
    sim.line("at rest after");
}

#[test]
fn speed_or_steering_alone_is_enough_but_not_neither() {
    let (_sim, port) = sim("ucp");
    for (args, target) in
        [("--speed 30", "speed 30 %, turn 0 %"), ("--turn -30", "speed 0 %, turn 30 % left")]
    {
        let lines = Process::start(&format!("drive -p {port} {args} -f 0.2")).success();
        assert!(lines[0].ends_with(&format!("target: {target}")), "{lines:?}");
    }
    let error = Process::start(&format!("drive -p {port} -f 0.2")).complaint(2);
    assert_eq!(error, "the following required arguments were not provided: --speed <S>");
}

#[test]
fn reports_from_before_the_robot_heard_of_the_stop_do_not_count() {
    for delay in ["0.05", "0.3"] {
        let (sim, port) = sim(&format!("ucp --delay {delay}"));
        Process::start(&format!("drive -p {port} --speed 60 --turn 0 -f 0.1")).success();
        // No wait: the rover has moved already. At 2 rpm or less it is as good as at rest.
        let lines = sim.lines();
        assert!(lines.iter().any(|line| line.ends_with("  moving")), "{delay}: {lines:?}");
        sim.line("at rest after");
    }
}

#[test]
fn a_rover_that_reports_nothing_any_more_is_not_said_to_turn() {
    let (mut decoder, mut is_told) = (ucp::Decoder::new(), false);
    let line = PlayedLine::new((), move |_, mut bytes| {
        let mut said = Vec::new();
        while let Some(event) = decoder.decode(&mut bytes) {
            let Event::Frame(frame) = event else { continue };
            match frame.message() {
                Message::Ping(_) => {
                    said.extend(Pong::new(ErrorCode::Fine).frame(0).as_bytes());
                }
                Message::MotorControl(command) => is_told |= command.speed() != 0,
                _ => {}
            }
        }
        if !is_told {
            said.extend(FirmwareReport::new(&Telemetry::default(), 50).frame(0).as_bytes());
        }
        said
    });
    let drive = format!("drive -p {} --speed 30 --turn 0 -f 0.3", line.path);
    let error = Process::start(&drive).complaint(1);
    assert!(error.ends_with("times to stop, but sends no reports: it may be moving"), "{error}");
}

#[test]
fn a_rover_whose_host_dies_stops_by_its_watchdog() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed 60 --turn 0 --for 600"));
    sim.line("moving");
    drive.kill();
    sim.line("watchdog");
    sim.line("at rest");
}

#[test]
fn a_rover_that_vanishes_is_reported_with_what_it_means() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed 60 --turn 0 --for 600"));
    sim.line("command: speed 60 %");
    sim.kill();
    let line = drive.complaint(1);
    assert!(line.starts_with(&format!("port {port:?} failed: disconnected")), "{line}");
    assert!(line.contains("can no longer be told to stop"), "{line}");
}

#[test]
fn a_robot_that_never_answers_is_never_told_to_move() {
    let (line, begin) = (parrot(&[]), Instant::now());
    let drive = Process::start(&format!("drive --port {} --speed 60 --turn 0", line.path));
    let complaint = drive.complaint(1);
    assert!(begin.elapsed() >= Duration::from_secs(2), "{:?}", begin.elapsed());
    assert!(complaint.starts_with("no robot answers on"), "{complaint}");
    assert!(complaint.ends_with("nothing received in 2 s"), "{complaint}");

    let heard = line.lock();
    let (mut commands, mut pings) = (0, 0);
    let (mut decoder, mut bytes) = (ucp::Decoder::new(), &heard[..]);
    while let Some(event) = decoder.decode(&mut bytes) {
        let Event::Frame(frame) = event else { panic!("{event:?}") };
        match frame.message() {
            Message::MotorControl(command) => {
                assert_eq!((command.speed(), command.angular()), (0, 0));
                assert!(pings > 0 || commands == 0, "{frame:?}");
                commands += 1;
            }
            Message::Ping(_) => pings += 1,
            other => panic!("{other:?}"),
        }
        assert!(commands > 0, "the first frame is a stop");
    }
    assert!(commands >= 3 && pings > 0);
}

#[test]
fn a_robot_that_talks_garbage_is_no_robot() {
    let line = parrot(&[0xFD, 0xFF, 0x28, 0x00, 0x05, 0x00, 0xFD]);
    let drive = Process::start(&format!("drive --port {} --speed 60 --turn 0", line.path));
    let complaint = drive.complaint(1);
    assert!(complaint.contains("bytes but no message received"), "{complaint}");
}

#[test]
fn a_host_that_floods_is_still_served_afterwards() {
    let (sim, port) = sim("ucp");
    let mut flood = vec![0x5A; 60];
    flood.extend(Ping {}.frame(0).as_bytes());
    let mut host =
        serialport::new(&port, ucp::BAUD).timeout(Duration::from_secs(10)).open().unwrap();
    for _ in 0..2000 {
        host.write_all(&flood).unwrap();
    }
    drop(host);
    Process::start(&format!("drive --port {port} --speed 10 --turn 0 --for 0.2")).success();
    sim.line("command: speed 10 %");
    sim.signal("TERM");
    let lines = sim.success();
    let served: Vec<_> = lines.last().unwrap().split_whitespace().collect();
    let pings: u32 =
        served[served.iter().position(|word| *word == "pings,").unwrap() - 1].parse().unwrap();
    assert!(pings >= 2000, "no ping was lost: {pings}");
}

#[test]
fn the_time_that_was_asked_for_is_kept() {
    let line = played::rover(None);
    let args = format!("drive --port {} --speed 20 --turn 0 --for 0.7", line.path);
    Process::start(&args).success();
    let commands = line.lock().commands.clone();
    let driven = commands.iter().filter(|command| **command == (20, 0)).count();
    assert!((7..=8).contains(&driven), "every 100 ms for 0.7 s: {commands:?}");
}

#[test]
fn turning_on_the_spot_counts_as_moving() {
    let line = played::rover(None);
    let args = format!("drive --port {} --speed 0 --turn 40 --for 0.3 --json", line.path);
    let drive = Process::start(&args);
    wait_until("the drive", || line.lock().commands.contains(&(0, 40)));
    // The mean of its wheel speeds is 0.
    line.lock().wheels = Some([28, -28, 28, -28]);
    let ended = drive.end();
    let outcome: serde_json::Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!((ended.code, &outcome["at_rest"]), (Some(1), &false.into()));
    let complaint = outcome["failure"].as_str().unwrap();
    assert_eq!(ended.stderr, [format!("axle: {complaint}")]);
    assert!(complaint.starts_with("the robot was told "), "{complaint}");
    assert!(complaint.ends_with(" times to stop, but its wheels are still turning"), "{complaint}");
    let commands = line.lock().commands.clone();
    let stops = commands.iter().rev().take_while(|command| **command == (0, 0)).count();
    assert!(stops >= 5, "stops are repeated: {commands:?}");
}

#[test]
fn one_wheel_that_turns_is_a_rover_that_moves() {
    for wheel in 0..4 {
        let mut wheels = [0; 4];
        wheels[wheel] = -3;
        let line = played::rover(None);
        let args = format!("drive --port {} --speed 30 --turn 0 --for 0.1", line.path);
        let drive = Process::start(&args);
        wait_until("the drive", || line.lock().commands.contains(&(30, 0)));
        line.lock().wheels = Some(wheels);
        thread::sleep(Duration::from_millis(1200));
        assert!(!drive.lines().iter().any(|line| line.contains("stopped")), "{wheels:?}");
        line.lock().wheels = None;
        assert!(drive.success().last().unwrap().ends_with("stopped"));
    }
}

#[test]
fn a_rover_that_falls_silent_may_be_moving_and_is_told_to_stop_all_the_same() {
    let line = played::rover(None);
    let drive =
        Process::start(&format!("drive --port {} --speed 60 --turn 0 --for 600", line.path));
    wait_until("the drive", || line.lock().commands.contains(&(60, 0)));
    line.lock().is_dumb = true;
    let complaint = drive.complaint(1);
    assert!(complaint.ends_with("is no longer heard: it may be moving"), "{complaint}");
    let commands = line.lock().commands.clone();
    let stops = commands.iter().rev().take_while(|command| **command == (0, 0)).count();
    assert!(stops >= 5, "stops are repeated: {commands:?}");
}

#[test]
fn a_rover_that_falls_silent_while_it_stops_may_be_moving() {
    let line = played::rover(None);
    let args = format!("drive --port {} --speed 60 --turn 0 --for 0.3", line.path);
    let drive = Process::start(&args);
    wait_until("the drive", || line.lock().commands.contains(&(60, 0)));
    line.lock().wheels = Some([60; 4]);
    wait_until("the stop", || line.lock().commands.last() == Some(&(0, 0)));
    line.lock().is_dumb = true;
    let complaint = drive.complaint(1);
    assert!(complaint.ends_with("is no longer heard: it may be moving"), "{complaint}");
}

#[test]
fn in_reverse_the_nose_swings_the_other_way_and_the_tool_says_so() {
    let cases = [
        ("--speed 60 --turn 50", "speed 60 %, turn 50 % right", 1.0),
        ("--speed 60 --turn -50", "speed 60 %, turn 50 % left", -1.0),
        ("--speed -60 --turn 50", "turn 50 % right (in reverse: the nose swings left)", -1.0),
        ("--speed -60 --turn -50", "turn 50 % left (in reverse: the nose swings right)", 1.0),
        ("--speed 0 --turn 50", "speed 0 %, turn 50 % right", 1.0),
    ];
    for (args, expected, side) in cases {
        let (sim, port) = sim("ucp");
        let lines = Process::start(&format!("drive --port {port} {args} --for 0.5")).success();
        assert!(lines[0].ends_with(expected), "{args}: {lines:?}");
        let still = sim.line("at rest after");
        let heading: f64 = still.split_whitespace().rev().nth(1).unwrap().parse().unwrap();
        // Compass headings: left of north is just below 360.
        let swung = if heading > 180.0 { heading - 360.0 } else { heading };
        assert!(swung * side > 3.0, "{args}: {still}");
    }
}

#[test]
fn drive_as_json_has_a_target_reports_a_stop_and_an_outcome() {
    let (_sim, port) = sim("ucp");
    let drive = format!("drive -p {port} --speed 50 --turn 20 -f 1 -j");
    let lines = Process::start(&drive).success();
    let records: Vec<serde_json::Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let [target, reports @ .., stopped, outcome] = &records[..] else { panic!("{lines:?}") };
    let expected = serde_json::json!(
        {"event": "target", "speed": 50, "angular": 20, "seconds": 0.0}
    );
    assert_eq!(*target, expected);
    assert!(!reports.is_empty() && reports.iter().all(|it| it["event"] == "report"));
    assert!(reports.last().unwrap()["rpm"][0].as_i64().unwrap() > 0, "{reports:?}");
    assert_eq!(stopped["event"], "stopped");
    assert!(stopped["rpm"][0].as_i64().unwrap() <= 2, "{stopped}");
    assert_eq!(*outcome, serde_json::json!({"event": "outcome", "at_rest": true}));
}
