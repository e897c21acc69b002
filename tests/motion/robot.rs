//! The robot, alone and behind a driver: which command is in force, and what was reported.

use axlewire::{
    drive::Driver,
    endpoint::Endpoint,
    time::{Duration, Instant},
    ucp::{
        Body, Frame, Message, MotorControl, Robot,
        message::{
            Biases, CalibrationKind, CalibrationStart, ErrorCode, ImuBias, ImuBiasAck, MagBias,
            NetworkState, SetNetworkState,
        },
        robot::{RobotConfig, RobotEvent},
    },
};
use embedded_io::Write;

use crate::port::{Port, World};

// The calls under test.

fn robot(now: Instant) -> Robot {
    Robot::new(RobotConfig::default(), now)
}

fn ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

fn bytes<B: Body>(body: B) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

fn go(speed: i16) -> Vec<u8> {
    bytes(MotorControl::new(speed, 0).unwrap())
}

fn sent(robot: &mut Robot, now: Instant) -> Vec<Vec<u8>> {
    let mut frames = vec![];
    while let Some(frame) = robot.poll_transmit(now) {
        frames.push(frame.to_vec());
    }
    frames
}

fn events(robot: &mut Robot) -> Vec<RobotEvent> {
    core::iter::from_fn(|| robot.poll_event()).collect()
}

// Commands

/// A robot whose application drives at 50 and was then held up for 400 ms, during which twenty
/// commands arrived, then this one.
fn held_up(last: i16) -> (World, Driver<Robot, Port, World>, Port) {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 87);
    let mut robot = Driver::new(robot(world.now()), near, world.clone());
    far.write(&go(50)).unwrap();
    let command = robot.next_command(ms(100)).unwrap();
    assert_eq!(command.map(|command| command.speed()), Some(50));
    for speed in 60..80 {
        far.write(&go(speed)).unwrap();
        world.step(20_000);
    }
    far.write(&go(last)).unwrap();
    world.step(5000);
    (world, robot, far)
}

#[test]
fn the_command_that_is_handed_out_after_a_pause_is_the_one_in_force() {
    let (world, mut robot, _far) = held_up(33);
    let deadline = world.now() + Duration::from_millis(100);
    let command = robot.next_command(deadline).unwrap().map(|command| command.speed());
    assert_eq!(robot.role().command(world.now()).speed(), 33);
    assert_eq!(command, Some(33), "a replaced command is handed out");
}

#[test]
fn a_stop_is_handed_out_however_many_commands_came_before_it() {
    for is_async in [false, true] {
        let (world, mut robot, mut far) = held_up(0);
        let mut speed = 50;
        for _ in 0..30 {
            far.write(&go(0)).unwrap();
            let deadline = world.now() + Duration::from_millis(100);
            let command = match is_async {
                true => world.block_on(robot.next_command_async(deadline)),
                false => robot.next_command(deadline),
            };
            speed = command.unwrap().map_or(speed, |command| command.speed());
        }
        assert_eq!(robot.role().command(world.now()).speed(), 0);
        assert_eq!(speed, 0, "the application keeps driving after a stop");
    }
}

// Reported events

/// Fills the event queue; no event is taken.
fn flood(robot: &mut Robot, now: Instant) {
    let state = SetNetworkState::new(NetworkState::Connected).unwrap();
    (0..20).for_each(|_| robot.handle_input(&bytes(state), now));
}

#[test]
fn biases_are_requested_until_the_application_will_find_them() {
    let mut robot = robot(ms(0));
    let biases = Biases::new(ImuBias::new([1; 3], [2; 3]), MagBias::new([3; 3]));
    assert!(!sent(&mut robot, ms(0)).is_empty(), "it sends a request");
    flood(&mut robot, ms(10));
    robot.handle_input(&bytes(biases), ms(20));
    let mut told = events(&mut robot);
    // The host answers every request.
    for now in 1..=5 {
        let is_request = |frame: &Vec<u8>| {
            matches!(Frame::parse(frame).unwrap().message(), Message::BiasRequest(_))
        };
        if sent(&mut robot, ms(1000 * now)).iter().any(is_request) {
            robot.handle_input(&bytes(biases), ms(1000 * now + 10));
        }
        told.extend(events(&mut robot));
    }
    let is_told = told.contains(&RobotEvent::Biases(biases));
    assert!(is_told, "the biases are lost, and the robot stops requesting");
}

#[test]
fn a_calibration_start_is_acknowledged_only_when_the_application_will_find_it() {
    let (mut robot, start) = (robot(ms(0)), CalibrationStart::new(CalibrationKind::Imu));
    flood(&mut robot, ms(0));
    for now in 1..=10 {
        robot.handle_input(&bytes(start), ms(200 * now));
        sent(&mut robot, ms(200 * now));
    }
    let mut told = events(&mut robot);
    // Again, for a host that has not received its acknowledgement.
    robot.handle_input(&bytes(start), ms(2200));
    told.extend(events(&mut robot));
    let is_told = told
        .contains(&RobotEvent::CalibrationStart { kind: CalibrationKind::Imu, repeated: false });
    assert!(is_told, "the start is acknowledged ten times, but never reported");
}

#[test]
fn a_calibration_whose_result_was_delivered_is_over() {
    let (mut robot, start) = (robot(ms(0)), CalibrationStart::new(CalibrationKind::Imu));
    let begun = RobotEvent::CalibrationStart { kind: CalibrationKind::Imu, repeated: false };
    robot.handle_input(&bytes(start), ms(0));
    assert!(events(&mut robot).contains(&begun));
    robot.calibration_result_imu(ImuBias::new([1; 3], [2; 3]), ms(100));
    sent(&mut robot, ms(100));
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(110));
    assert!(events(&mut robot).contains(&RobotEvent::ImuBiasTaken));
    robot.handle_input(&bytes(start), ms(3_600_000));
    let is_told = events(&mut robot).contains(&begun);
    assert!(is_told, "the new start is acknowledged, but not reported");
}
