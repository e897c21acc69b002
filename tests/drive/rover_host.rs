//! The host behind a driver: what is owed, what is kept, what is current.

use std::{cell::RefCell, rc::Rc};

use axlewire::{
    drive::{DriveError, Operation},
    stream::Frames,
    ucp::Ucp,
};

use crate::{
    port::{Port, Step, World},
    rig::On,
    rover_rig::*,
};

/// The speeds of the motor commands in these bytes.
fn written_speeds(written: &[u8]) -> Vec<i16> {
    Frames::<Ucp>::new(written).filter_map(|frame| speed(frame.as_bytes())).collect()
}

/// A host behind a driver whose port is controlled by the test.
fn scripted() -> (World, On<Host, Port, World>) {
    let world = World::default();
    let port = Port::new(&world, 0);
    (world.clone(), On::new(fresh_host(), port, world))
}

#[test]
fn a_command_of_which_no_byte_has_left_is_not_sent_late() {
    let (world, mut rover) = scripted();
    rover.port_mut().writes.push_back(Step::Error);
    assert!(rover.drive(100, 0).is_err());
    world.step(10_000_000);
    rover.stop().unwrap();
    let is_sent = written_speeds(&rover.port().written).contains(&100);
    assert!(!is_sent, "a ten-second-old command is sent before the stop");
}

#[test]
fn a_stop_whose_frame_was_discarded_goes_out_with_the_next_stop() {
    let (world, mut rover) = scripted();
    rover.drive(60, 0).unwrap();
    world.step(50_000);
    rover.port_mut().writes.push_back(Step::Error);
    rover.role_mut().stop(world.now());
    assert!(rover.service().is_err());
    rover.discard();
    assert!(!rover.role().is_stop_sent());
    rover.stop().unwrap();
    let last = written_speeds(&rover.port().written).pop();
    assert_eq!(last, Some(0), "stop is Ok with nothing on the line");
}

#[test]
fn a_network_state_whose_frame_was_discarded_is_sent_again() {
    let (world, mut rover) = scripted();
    rover.service().unwrap();
    rover.role_mut().set_network_state(NetworkState::Connected, world.now()).unwrap();
    rover.port_mut().writes.push_back(Step::Error);
    assert!(rover.service().is_err());
    rover.discard();
    for _ in 0..100 {
        world.step(10_000);
        rover.service().unwrap();
    }
    let mut frames = Frames::<Ucp>::new(&rover.port().written);
    let is_sent = frames.any(|frame| matches!(frame.message(), Message::SetNetworkState(_)));
    assert!(is_sent, "the lamp never shows the recorded state");
}

#[test]
fn the_answer_to_a_start_is_not_taken_for_the_answer_to_an_end() {
    for is_async in [false, true] {
        let (world, kind) = (World::default(), CalibrationKind::Imu);
        let (near, mut far) = Port::pair(&world, 87);
        let clock = world.clone();
        let mut rover = On::new(fresh_host(), near, clock);
        let deadline = world.now() + Duration::from_millis(10);
        let within = deadline - rover.now();
        let started = rover.start_calibration(kind, within);
        assert_eq!(started, Err(DriveError::Timeout(Operation::Calibration)));
        let answer = bytes(CalibrationStartAck::new(kind, ErrorCode::Fine));
        embedded_io::Write::write(&mut far, &answer).unwrap();
        world.step(2000);
        rover.service().unwrap();
        // From here on the line is silent.
        let deadline = world.now() + Duration::from_millis(2000);
        let within = deadline - rover.now();
        let ended = match is_async {
            true => world.block_on(rover.asynch().end_calibration(kind, within)),
            false => rover.end_calibration(kind, within),
        };
        assert!(ended.is_err(), "a silent robot is reported to have ended its calibration");
    }
}

#[test]
fn a_report_taken_ten_times_a_second_is_not_older_than_200_ms() {
    let world = World::default();
    let (near, far) = Port::pair(&world, 87);
    let robot = Robot::new(RobotConfig::default(), world.now());
    let robot = Rc::new(RefCell::new(On::new(robot, far, world.clone())));
    let time = world.clone();
    world.add(move || {
        // The heading encodes the measurement time, in hundredths of a second.
        let heading_deg = (time.now().as_micros() / 10_000) as i16;
        let telemetry = Telemetry { heading_deg, ..Telemetry::default() };
        let mut robot = robot.borrow_mut();
        robot.role_mut().set_telemetry(&telemetry, time.now());
        robot.service().unwrap();
    });
    let clock = world.clone();
    let mut rover = On::new(fresh_host(), near, clock);
    let mut age_ms = 0;
    for _ in 0..40 {
        (0..1000).for_each(|_| world.step(100));
        let report = rover.next_report(Duration::from_millis(50)).unwrap().unwrap();
        let measured_ms = 10 * u64::from(report.telemetry.heading_deg.unsigned_abs());
        age_ms = world.now().as_micros() / 1000 - measured_ms;
    }
    assert!(age_ms <= 200, "outdated reports are returned: {age_ms} ms");
}
