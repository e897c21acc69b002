//! The host of a rover, alone and behind a driver: what is owed, what is kept, what is current.

use std::{cell::RefCell, rc::Rc};

use axlewire::{
    drive::{DriveError, Driver, Operation},
    endpoint::Endpoint,
    stream::Frames,
    time::{Duration, Instant},
    ucp::{
        Body, Frame, Host, Message, Robot, Telemetry, Ucp,
        host::{BiasStore, HostConfig, HostEvent, MemoryStore, NoStore},
        message::{
            BiasRequest, CalibrationKind, CalibrationStartAck, ErrorCode, FirmwareReport, ImuBias,
            MagBias, NetworkState, OtaAck, OtaStatus,
        },
        robot::RobotConfig,
    },
};

use crate::port::{Port, Step, World};

// The calls under test.

fn host<S: BiasStore>(store: S, now: Instant) -> Host<S> {
    let mut config = HostConfig::default();
    config.ping_period = None;
    Host::with_store(config, store, now)
}

/// A host behind a driver whose port is controlled by the test.
fn scripted() -> (World, Driver<Host, Port, World>) {
    let world = World::default();
    let port = Port::new(&world, 0);
    (world.clone(), Driver::new(host(NoStore, world.now()), port, world))
}

// What the far end sends and receives.

fn ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

fn bytes<B: Body>(body: B) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

fn imu(value: i16) -> ImuBias {
    ImuBias::new([value; 3], [-value; 3])
}

fn sent<R: Endpoint>(role: &mut R, now: Instant) -> Vec<Vec<u8>> {
    let mut frames = vec![];
    while let Some(frame) = role.poll_transmit(now) {
        frames.push(frame.to_vec());
    }
    frames
}

fn events<R: Endpoint>(role: &mut R) -> Vec<R::Event> {
    core::iter::from_fn(|| role.poll_event()).collect()
}

/// The speeds of the motor commands in these bytes.
fn speeds(written: &[u8]) -> Vec<i16> {
    let frames = Frames::<Ucp>::new(written);
    let speeds = frames.filter_map(|frame| match frame.message() {
        Message::MotorControl(command) => Some(command.speed()),
        _ => None,
    });
    speeds.collect()
}

// Stops

#[test]
fn a_command_of_which_no_byte_has_left_is_not_sent_late() {
    let (world, mut rover) = scripted();
    rover.port_mut().writes.push_back(Step::Error);
    assert!(rover.drive(100, 0).is_err());
    world.step(10_000_000);
    rover.stop().unwrap();
    let is_sent = speeds(&rover.port().written).contains(&100);
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
    let last = speeds(&rover.port().written).pop();
    assert_eq!(last, Some(0), "stop is Ok with nothing on the line");
}

// Discarded frames

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

// Results

/// Passes in the result of a calibration; returns whether it has been acknowledged.
fn is_acknowledged<S: BiasStore>(host: &mut Host<S>, bias: ImuBias, now: Instant) -> bool {
    host.handle_input(&bytes(bias), now);
    let is_ack =
        |frame: &Vec<u8>| matches!(Frame::parse(frame).unwrap().message(), Message::ImuBiasAck(_));
    sent(host, now).iter().any(is_ack)
}

#[test]
fn reports_that_nobody_takes_out_do_not_cost_a_result() {
    let mut host = host(NoStore, ms(0));
    for index in 0..16 {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        host.handle_input(report.as_bytes(), ms(20 * u64::from(index)));
    }
    is_acknowledged(&mut host, imu(1), ms(400));
    let is_told = events(&mut host).contains(&HostEvent::ImuBias(imu(1)));
    assert!(is_told, "reports took the room of the result");
}

#[test]
fn a_result_is_acknowledged_only_when_the_application_will_find_it() {
    let mut host = host(NoStore, ms(0));
    for _ in 0..20 {
        host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), ms(0));
    }
    let mut was_acknowledged = is_acknowledged(&mut host, imu(1), ms(0));
    let mut told = events(&mut host);
    // The robot sends it again if it was not acknowledged.
    was_acknowledged |= is_acknowledged(&mut host, imu(1), ms(1000));
    told.extend(events(&mut host));
    assert!(was_acknowledged);
    let is_told = told.contains(&HostEvent::ImuBias(imu(1)));
    assert!(is_told, "the result is acknowledged, but never reaches the application");
}

#[test]
fn the_biases_that_are_sent_are_those_in_the_store() {
    let mag = MagBias::new([7; 3]);
    let mut host = host(MemoryStore { imu: Some(imu(1)), mag: Some(mag) }, ms(0));
    host.handle_input(&[bytes(BiasRequest {}), bytes(imu(2))].concat(), ms(0));
    let frames = sent(&mut host, ms(0));
    let biases = frames.iter().find_map(|frame| match Frame::parse(frame).unwrap().message() {
        Message::Biases(biases) => Some(biases.imu()),
        _ => None,
    });
    assert_eq!(biases, Some(imu(2)), "superseded biases are sent");
}

#[test]
fn the_answer_to_a_start_is_not_taken_for_the_answer_to_an_end() {
    for is_async in [false, true] {
        let (world, kind) = (World::default(), CalibrationKind::Imu);
        let (near, mut far) = Port::pair(&world, 87);
        let clock = world.clone();
        let mut rover = Driver::new(host(NoStore, world.now()), near, clock);
        let deadline = world.now() + Duration::from_millis(10);
        let started = rover.start_calibration(kind, deadline);
        assert_eq!(started, Err(DriveError::Timeout(Operation::Calibration)));
        let answer = bytes(CalibrationStartAck::new(kind, ErrorCode::Fine));
        embedded_io::Write::write(&mut far, &answer).unwrap();
        world.step(2000);
        rover.service().unwrap();
        // From here on the line is silent.
        let deadline = world.now() + Duration::from_millis(2000);
        let ended = match is_async {
            true => world.block_on(rover.end_calibration_async(kind, deadline)),
            false => rover.end_calibration(kind, deadline),
        };
        assert!(ended.is_err(), "a silent robot is reported to have ended its calibration");
    }
}

// Reports

#[test]
fn a_report_taken_ten_times_a_second_is_not_older_than_200_ms() {
    let world = World::default();
    let (near, far) = Port::pair(&world, 87);
    let robot = Robot::new(RobotConfig::default(), world.now());
    let robot = Rc::new(RefCell::new(Driver::new(robot, far, world.clone())));
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
    let mut rover = Driver::new(host(NoStore, world.now()), near, clock);
    let mut age_ms = 0;
    for _ in 0..40 {
        (0..1000).for_each(|_| world.step(100));
        let deadline = world.now() + Duration::from_millis(50);
        let report = rover.next_report(deadline).unwrap().unwrap();
        let measured_ms = 10 * u64::from(report.telemetry.heading_deg.unsigned_abs());
        age_ms = world.now().as_micros() / 1000 - measured_ms;
    }
    assert!(age_ms <= 200, "outdated reports are returned: {age_ms} ms");
}
