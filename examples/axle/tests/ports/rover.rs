//! `axle ping`, `calibrate`, `lamp` and `network`: a rover that does not move because of them.

use std::{
    io::Write,
    process::Stdio,
    thread,
    time::{Duration, Instant},
};

use axlewire::{crc16, stream::Event, ucp};
use serde_json::Value;

use super::{
    Process,
    played::{self, PlayedLine, parrot},
    sim,
    support::axle,
};

fn objects(lines: &[String]) -> Vec<Value> {
    lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// No command that moves anything was among what the rover got.
fn assert_nothing_moved(sim: Process) {
    sim.signal("INT");
    let lines = sim.success();
    let is_motion = |line: &&String| line.contains("command: speed") || line.contains("moving");
    for line in lines.iter().filter(is_motion) {
        assert!(line.contains("command: speed 0 %, turn 0 %"), "{line}");
    }
}

#[test]
fn ping_counts_its_pongs_and_their_times() {
    let (sim, port) = sim("ucp");
    let lines = Process::start(&format!("ping -p {port} --count 3 --every 0.05")).success();
    assert_eq!(lines.iter().filter(|line| line.contains("pong after ")).count(), 3, "{lines:?}");
    let summary = lines.last().unwrap();
    assert!(summary.starts_with("3 pings, 3 pongs, 0 lost; round trip: min "), "{summary}");

    let lines = Process::start(&format!("ping -p {port} -c 2 -j")).success();
    let records = objects(&lines);
    let [one, two, summary] = &records[..] else { panic!("{lines:?}") };
    let times: Vec<_> = [one, two].map(|pong| pong["round_trip_us"].as_u64().unwrap()).to_vec();
    assert_eq!((&one["event"], &one["damaged"]), (&"pong".into(), &false.into()));
    assert_eq!(summary["min_us"].as_u64(), times.iter().copied().min());
    assert_eq!(summary["max_us"].as_u64(), times.iter().copied().max());
    let mean = summary["mean_us"].as_u64().unwrap();
    assert_eq!(mean, (times[0] + times[1]) / 2);
    assert_nothing_moved(sim);
}

#[test]
fn ping_ends_after_its_time_and_on_a_signal_with_a_summary() {
    let (_sim, port) = sim("ucp");
    let lines = Process::start(&format!("ping -p {port} --for 0.5 --every 0.05")).success();
    assert!(lines.last().unwrap().contains(" pongs, 0 lost"), "{lines:?}");
    // At the beginning, and then ten times; the tool's own clock decides.
    assert!((2..=11).contains(&(lines.len() - 1)), "{lines:?}");
    let ping = Process::start(&format!("ping -p {port}"));
    ping.line("pong after ");
    ping.signal("INT");
    let lines = ping.success();
    assert!(lines.last().unwrap().contains(" pongs, 0 lost"), "{lines:?}");
}

#[test]
fn ping_ends_by_itself_after_ten_pings() {
    let (_sim, port) = sim("ucp");
    let lines = Process::start(&format!("ping -p {port} --every 0.02")).success();
    assert!(lines.last().unwrap().starts_with("10 pings, 10 pongs, 0 lost"), "{lines:?}");
}

#[test]
fn pings_without_a_pong_are_lost_and_the_exit_code_says_so() {
    let line = parrot(&[]);
    let ended = Process::start(&format!("ping -p {} -c 2 --every 0.05", line.path)).end();
    assert_eq!(ended.code, Some(1));
    assert_eq!(ended.stdout.last().unwrap(), "2 pings, 0 pongs, 2 lost");
    assert_eq!(ended.stdout.iter().filter(|it| it.ends_with("no pong")).count(), 2);
    assert_eq!(ended.stderr, [format!("axle: no robot answers on {:?}", line.path)]);
    let heard = line.lock();
    // The first frame is a stop: a motor command of zeros (ruling U16).
    assert_eq!(heard[..5], [0xFD, 0xFF, 20, 0, 2]);
    assert!(heard[6..22].iter().all(|byte| *byte == 0), "{:02x?}", &heard[..24]);
}

#[test]
fn the_lamp_goes_on_and_off_and_the_wheels_stand_still() {
    let (sim, port) = sim("ucp");
    let on = Process::start(&format!("lamp -p {port} on")).success();
    assert_eq!(on, ["lamp on: told 3 times"]);
    sim.line("command: speed 0 %, turn 0 %, lamp on");
    let off = Process::start(&format!("lamp -p {port} off")).success();
    assert_eq!(off, ["lamp off: told 3 times"]);
    let lines = sim.lines();
    let lamps: Vec<_> = lines.iter().filter(|line| line.contains("lamp")).collect();
    assert!(lamps.last().unwrap().ends_with("lamp off"), "{lamps:?}");
    assert_nothing_moved(sim);
}

#[test]
fn the_lamp_is_told_as_often_as_it_says() {
    let (_sim, port) = sim("ucp");
    let path = std::env::temp_dir().join(format!("axle-lamp-{}.pcapng", std::process::id()));
    let path = path.to_str().unwrap();
    let lamp = format!("lamp -p {port} --record {path} on");
    assert_eq!(Process::start(&lamp).success(), ["lamp on: told 3 times"]);
    let lines = Process::start(&format!("decode --json {path}")).success();
    std::fs::remove_file(path).unwrap();
    let lit = objects(&lines).into_iter().filter(|frame| frame["front_led"] == 100);
    assert_eq!(lit.count(), 3, "{lines:?}");
}

#[test]
fn a_state_of_the_network_reaches_the_rover() {
    let (sim, port) = sim("ucp");
    for (state, shown) in
        [("connected", "connected"), ("sim-absent", "SIM absent"), ("ota", "firmware update")]
    {
        let lines = Process::start(&format!("network -p {port} {state}")).success();
        assert_eq!(lines, [format!("network {shown}: sent")]);
        sim.line(&format!("network state: {shown}"));
    }
    assert_nothing_moved(sim);
}

#[test]
fn a_calibration_says_what_to_do_and_prints_the_biases() {
    let (sim, port) = sim("ucp");
    let lines = Process::start(&format!("calibrate -p {port} --kind imu --for 0.3")).success();
    assert!(lines[0].contains("keep the robot still until the time is up"), "{lines:?}");
    let biases = "biases: accelerometer 12 -7 30, gyroscope 4 -2 1";
    assert!(lines.last().unwrap().ends_with(biases), "{lines:?}");
    sim.line("calibration begins: IMU");
    sim.line("calibration ends: IMU");

    let args = format!("calibrate -p {port} -k magnetometer -f 1.7 -j");
    let lines = Process::start(&args).success();
    let records = objects(&lines);
    let names: Vec<_> = records.iter().map(|it| it["event"].as_str().unwrap()).collect();
    assert_eq!(names, ["started", "ended", "mag_bias"]);
    assert_eq!(records[2]["mag"], serde_json::json!([105, -48, 260]));
    let seconds = |at: usize| records[at]["seconds"].as_f64().unwrap();
    assert!((1.7..2.2).contains(&(seconds(1) - seconds(0))), "{records:?}");
    assert_nothing_moved(sim);
}

#[test]
fn pings_are_as_far_apart_as_asked_for_and_their_times_are_told() {
    let line = played::rover(None);
    for (every, least) in [("0.5", 1.0), ("0.05", 0.1)] {
        let args = format!("ping -p {} -c 3 --every {every} -j", line.path);
        let records = objects(&Process::start(&args).success());
        let at = |of: usize| records[of]["seconds"].as_f64().unwrap();
        let span = at(2) - at(0);
        assert!((least - 0.02..least + 0.3).contains(&span), "{every}: {records:?}");
    }
}

#[test]
fn a_lamp_is_told_three_times() {
    let line = played::rover(None);
    for (state, shines) in [("on", 100), ("off", 0)] {
        let before = line.lock().lamps.len();
        Process::start(&format!("lamp -p {} {state}", line.path)).success();
        let lamps = line.lock().lamps[before..].to_vec();
        // In front of them is a stop.
        assert_eq!((lamps[0], lamps.len() >= 4), (0, true), "{lamps:?}");
        assert!(lamps.iter().rev().take(3).all(|lamp| *lamp == shines), "{lamps:?}");
        assert!(line.lock().commands.iter().all(|command| *command == (0, 0)));
    }
}

#[test]
fn a_result_that_comes_late_is_waited_for() {
    let mut ended = None;
    let line = rover_that_calibrates(move |sent, body| match (sent, ended) {
        // It has an old result.
        (3, _) => vec![frame(6, &[9; 12]), frame(3, &[body[0], 0])],
        (4, _) => {
            ended = Some(Instant::now());
            vec![frame(4, &[body[0], 0])]
        }
        (_, Some(at)) if at.elapsed() >= Duration::from_millis(2500) => {
            vec![frame(6, &[1; 12])]
        }
        _ => Vec::new(),
    });
    let args = format!("calibrate -p {} -k imu -f 0.1 -j", line.path);
    let records = objects(&Process::start(&args).success());
    assert_eq!(records[2]["acc"], serde_json::json!([257, 257, 257]), "{records:?}");
    // In this time an old result comes and is acknowledged.
    let seconds = |at: usize| records[at]["seconds"].as_f64().unwrap();
    assert!((1.2..2.0).contains(&(seconds(1) - seconds(0))), "{records:?}");
}

#[test]
fn a_result_of_the_other_kind_is_not_taken_for_this_one() {
    for (kind, says) in [
        ("imu", "accelerometer 514 514 514, gyroscope 514 514 514"),
        ("magnetometer", "magnetometer 2313 2313 2313"),
    ] {
        let is_imu = kind == "imu";
        let line = rover_that_calibrates(move |sent, body| match sent {
            3 => vec![frame(3, &[body[0], 0])],
            4 => {
                let (imu, mag) = (frame(6, &[2; 12]), frame(7, &[9; 6]));
                let ack = frame(4, &[body[0], 0]);
                if is_imu { vec![ack, imu, mag] } else { vec![ack, mag, imu] }
            }
            _ => Vec::new(),
        });
        let args = format!("calibrate -p {} -k {kind} -f 0.1", line.path);
        let lines = Process::start(&args).success();
        assert!(lines.last().unwrap().ends_with(says), "{lines:?}");
    }
}

#[test]
fn a_result_of_an_earlier_calibration_is_not_taken_for_this_one() {
    let line = rover_that_calibrates(|sent, body| match sent {
        // It has an old result of both kinds, and its acknowledgement of the start is late.
        3 => vec![frame(7, &[9; 6]), frame(6, &[1; 12]), frame(3, &[body[0], 0])],
        4 => vec![frame(4, &[body[0], 0]), frame(6, &[2; 12])],
        _ => Vec::new(),
    });
    let args = format!("calibrate -p {} -k imu -f 0.1", line.path);
    let lines = Process::start(&args).success();
    let biases = "accelerometer 514 514 514, gyroscope 514 514 514";
    assert!(lines.last().unwrap().ends_with(biases), "{lines:?}");
}

#[test]
fn the_same_result_once_more_is_a_result() {
    let line = rover_that_calibrates(|sent, body| match sent {
        3 => vec![frame(6, &[1; 12]), frame(3, &[body[0], 0])],
        4 => vec![frame(4, &[body[0], 0]), frame(6, &[1; 12])],
        _ => Vec::new(),
    });
    let args = format!("calibrate -p {} -k imu -f 0.1", line.path);
    let lines = Process::start(&args).success();
    assert!(lines.last().unwrap().contains("accelerometer 257 257 257"), "{lines:?}");
}

#[test]
fn a_calibration_whose_start_is_not_acknowledged_is_ended_all_the_same() {
    let line = rover_that_calibrates(|_, _| Vec::new());
    let error = Process::start(&format!("calibrate -p {} -k imu -f 0.1", line.path)).complaint(1);
    assert!(error.starts_with("the calibration of the IMU does not begin: "), "{error}");
    let ids = line.lock().clone();
    assert!(ids.contains(&3) && ids.contains(&4), "{ids:?}");
}

#[test]
fn a_second_signal_does_not_keep_a_calibration_from_being_ended() {
    let mut ends = 0;
    let line = rover_that_calibrates(move |sent, body| match sent {
        3 => vec![frame(3, &[body[0], 0])],
        // The first two are lost.
        4 => {
            ends += 1;
            if ends == 3 { vec![frame(4, &[body[0], 0])] } else { Vec::new() }
        }
        _ => Vec::new(),
    });
    let calibrate = Process::start(&format!("calibrate -p {} -k imu -f 600", line.path));
    calibrate.line("has begun");
    calibrate.signal("INT");
    thread::sleep(Duration::from_millis(30));
    calibrate.signal("INT");
    assert_eq!(calibrate.complaint(1), "interrupted: the calibration was ended");
    assert_eq!(line.lock().iter().filter(|id| **id == 4).count(), 3);
}

#[test]
fn a_state_that_is_not_followed_by_an_answer_is_not_said_to_be_sent() {
    let line = rover_that_calibrates(|_, _| Vec::new());
    let error = Process::start(&format!("network -p {} connected", line.path)).complaint(1);
    let expected = "network connected: sent, but the robot does not answer any more";
    assert_eq!(error, expected);
}

/// A rover that reports, answers no ping, and answers calibration requests as told: it gets id and
/// body. Holds the ids of all that it has heard.
fn rover_that_calibrates(
    mut answers: impl FnMut(u8, &[u8]) -> Vec<Vec<u8>> + Send + 'static,
) -> PlayedLine<Vec<u8>> {
    let mut decoder = ucp::Decoder::new();
    PlayedLine::new(Vec::new(), move |heard, mut bytes| {
        let mut said = vec![frame(5, &[0; 36])];
        while let Some(event) = decoder.decode(&mut bytes) {
            let Event::Frame(frame) = event else { continue };
            let bytes = frame.as_bytes();
            heard.lock().unwrap().push(bytes[4]);
            said.extend(answers(bytes[4], &bytes[6..]));
        }
        said.concat()
    })
}

fn frame(id: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, body.len() as u8 + 4, 0, id, 0];
    frame.extend(body);
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}

#[test]
fn a_calibration_ends_on_enter_and_on_a_signal() {
    let (sim, port) = sim("ucp");
    let args = ["calibrate", "--port", &port, "--kind", "magnetometer"];
    let mut child = axle(&args).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    sim.line("calibration begins: magnetometer");
    child.stdin.take().unwrap().write_all(b"\n").unwrap();
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("then press Enter"), "{text}");
    assert!(text.contains("biases: magnetometer 105 -48 260"), "{text}");

    let calibrate = Process::start(&format!("calibrate --port {port} --kind imu"));
    sim.line("calibration begins: IMU");
    calibrate.line("then press Enter");
    // The end of the input is no Enter.
    thread::sleep(Duration::from_millis(1500));
    assert_eq!(calibrate.lines().len(), 1, "{:?}", calibrate.lines());
    calibrate.signal("INT");
    assert_eq!(calibrate.complaint(1), "interrupted: the calibration was ended");
    sim.line("calibration ends: IMU");
    assert_nothing_moved(sim);
}

#[test]
fn each_of_them_stops_a_rover_that_another_program_has_left_moving() {
    let cases = ["ping -c 1", "lamp on", "network connected", "calibrate -k imu -f 0.1"];
    for case in cases {
        let (sim, port) = sim("ucp");
        let drive = Process::start(&format!("drive -p {port} --speed 60 --turn 0 -f 600"));
        sim.line("moving");
        drive.kill();
        let (name, rest) = case.split_once(' ').unwrap();
        Process::start(&format!("{name} -p {port} {rest}")).success();
        sim.line("command: speed 0 %, turn 0 %");
        sim.line("at rest after");
    }
}

#[test]
fn a_rover_that_does_not_answer_is_named() {
    for case in ["lamp on", "network unknown", "calibrate --kind imu"] {
        let line = parrot(&[]);
        let (name, rest) = case.split_once(' ').unwrap();
        let complaint = Process::start(&format!("{name} -p {} {rest}", line.path)).complaint(1);
        assert!(complaint.starts_with("no robot answers on "), "{complaint}");
    }
}
