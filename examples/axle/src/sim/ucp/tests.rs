//! What a simulated rover tells of its host's requests, and how far it goes.

use axlewire::ucp::{Body, robot::UpdateSource};

use super::*;

#[test]
fn a_request_for_an_update_is_told_and_ignored() {
    let now = Instant::from_micros(0);
    let mut robot = Robot::new(RobotConfig::default(), now);
    let asked = RobotEvent::UpdateRequested { version: 40, by: UpdateSource::Request };
    let told = react(&mut robot, asked, now).unwrap().to_string();
    assert_eq!(told, "firmware update to version 40 requested and ignored");
    assert!(react(&mut robot, RobotEvent::ImuBiasTaken, now).is_none());
}

#[test]
fn a_command_counts_from_the_moment_at_which_the_rover_is_looked_at_and_not_before() {
    let at = Instant::from_millis;
    let mut robot = Robot::new(RobotConfig::default(), at(0));
    let mut moved = Moved { rover: Rover::new(), until: at(0) };
    robot.handle_input(MotorControl::new(50, 0).unwrap().frame(0).as_bytes(), at(400));
    moved.advance(&mut robot, at(400));
    assert_eq!((moved.rover.telemetry().rpm, moved.rover.distance_m()), ([0; 4], 0.0));
    moved.advance(&mut robot, at(450));
    assert!(moved.rover.distance_m() > 0.0);
}

#[test]
fn a_rover_goes_as_far_as_it_drives_long_however_often_it_is_looked_at() {
    let goes = |step_ms| {
        let start = Instant::from_micros(0);
        let mut robot = Robot::new(RobotConfig::default(), start);
        let mut moved = Moved { rover: Rover::new(), until: start };
        while moved.until.as_micros() < 2_000_000 {
            let now = moved.until + Duration::from_millis(step_ms);
            robot.handle_input(MotorControl::new(50, 0).unwrap().frame(0).as_bytes(), now);
            while robot.poll_event().is_some() {}
            moved.advance(&mut robot, now);
        }
        moved.rover.distance_m()
    };
    let expected = goes(1);
    assert!(expected > 0.2, "{expected}");
    for step_ms in [7, 10, 40] {
        let seen = goes(step_ms);
        assert!((seen / expected - 1.0).abs() < 0.1, "{step_ms}: {seen} {expected}");
    }
}
