//! Everything that a role acknowledges is available to its application, however full the queues are
//! (U15).

use crate::rig::*;

/// Update requests, until the queue of events is full.
fn fill(robot: &mut Robot, now: Instant) {
    (40..60).for_each(|it| robot.handle_input(&bytes(OtaRequest::start_firmware_update(it)), now));
}

#[test]
fn motor_events_never_take_the_room_of_rare_events() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    for turn in 0..50 {
        robot.handle_input(&bytes(go(turn)), ms(turn as u64));
    }
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(60));
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(60));
    let biases = Biases::new(imu_bias(), mag_bias());
    robot.handle_input(&bytes(biases), ms(60));
    let seen = events(&mut robot);
    assert_eq!(seen.last(), Some(&RobotEvent::Biases(biases)));
    assert!(seen.contains(&RobotEvent::CalibrationEnd(IMU)));
}

#[test]
fn biases_end_their_request_only_if_their_event_has_room() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    sent(&mut robot, ms(0));
    fill(&mut robot, ms(1));
    let biases = bytes(Biases::new(imu_bias(), mag_bias()));
    robot.handle_input(&biases, ms(2));
    let asked = wait(&mut robot, ms(1500));
    assert_eq!(asked.iter().filter(|(_, frame)| frame[4] == 8).count(), 1, "it requests again");
    assert_eq!(events(&mut robot).len(), 16);
    robot.handle_input(&biases, ms(1600));
    assert_eq!(events(&mut robot), [RobotEvent::Biases(Biases::new(imu_bias(), mag_bias()))]);
    assert_eq!(wait(&mut robot, ms(5000)), [], "and then no longer");
}

#[test]
fn a_calibration_start_is_acknowledged_only_when_the_application_will_find_it() {
    let mut robot = quiet_robot();
    fill(&mut robot, ms(1));
    let start = bytes(CalibrationStart::new(IMU));
    let end = bytes(CalibrationEnd::new(IMU));
    robot.handle_input(&start, ms(2));
    assert_eq!((sent(&mut robot, ms(2)), robot.calibrating()), (vec![], None));
    events(&mut robot);
    robot.handle_input(&start, ms(3));
    assert_eq!((sent(&mut robot, ms(3)).len(), robot.calibrating()), (1, Some(IMU)));
    fill(&mut robot, ms(4));
    robot.handle_input(&end, ms(5));
    assert_eq!((sent(&mut robot, ms(5)), robot.calibrating()), (vec![], Some(IMU)));
    events(&mut robot);
    robot.handle_input(&end, ms(6));
    assert_eq!((sent(&mut robot, ms(6)).len(), robot.calibrating()), (1, None));
    assert_eq!(events(&mut robot), [RobotEvent::CalibrationEnd(IMU)]);
}

#[test]
fn a_repeated_start_is_reported_with_a_flag() {
    let mut robot = quiet_robot();
    let start = bytes(CalibrationStart::new(IMU));
    robot.handle_input(&start, ms(1));
    assert_eq!(events(&mut robot), [begins(IMU)]);
    robot.handle_input(&start, ms(2));
    robot.handle_input(&start, ms(3));
    let repeated = RobotEvent::CalibrationStart { kind: IMU, repeated: true };
    assert_eq!(events(&mut robot), [repeated], "once while it waits");
    assert_eq!(sent(&mut robot, ms(3)).len(), 1);
    assert_eq!(robot.statistics().calibration_repeats, 2);
    // Another kind is another calibration.
    robot.handle_input(&bytes(CalibrationStart::new(MAG)), ms(4));
    assert_eq!((events(&mut robot), robot.calibrating()), (vec![begins(MAG)], Some(MAG)));
}

#[test]
fn a_calibration_can_be_aborted_by_the_robot() {
    let mut robot = quiet_robot();
    assert_eq!(robot.abort_calibration(), None);
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
    sent(&mut robot, ms(1));
    events(&mut robot);
    assert_eq!((robot.abort_calibration(), robot.calibrating()), (Some(IMU), None));
    // The host's end is acknowledged without effect; its next start is reported.
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(2));
    assert_eq!((sent(&mut robot, ms(2)).len(), events(&mut robot)), (1, vec![]));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(3));
    assert_eq!(events(&mut robot), [begins(IMU)]);
}

#[test]
fn the_acknowledgement_of_an_older_result_ends_no_new_calibration() {
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    sent(&mut robot, ms(0));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(2));
    assert_eq!(robot.calibrating(), Some(IMU));
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(3));
    let told = [begins(IMU), RobotEvent::ImuBiasTaken, RobotEvent::CalibrationEnd(IMU)];
    assert_eq!(events(&mut robot), told);
}

#[test]
fn an_acknowledgement_is_not_for_a_result_that_has_not_been_sent() {
    let mut robot = quiet_robot();
    both_results(&mut robot, 0);
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(1));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(1));
    assert_eq!((events(&mut robot), robot.statistics().acks_refused), (vec![], 2));
    assert_eq!(sent(&mut robot, ms(1)).len(), 2);
}

#[test]
fn the_latest_command_and_network_state_have_getters_and_are_the_newest_of_their_events() {
    let mut robot = quiet_robot();
    assert_eq!(robot.network_state(), None);
    for turn in 1..=30_u32 {
        robot.handle_input(&bytes(go(turn as i16)), ms(turn.into()));
        let state = SetNetworkState::new(NetworkState::from(turn)).unwrap();
        robot.handle_input(&bytes(state), ms(turn.into()));
    }
    assert_eq!(robot.network_state(), Some(NetworkState::Other(30)));
    robot.handle_timeout(ms(600));
    let seen = events(&mut robot);
    assert!(seen.len() <= 9 && robot.lost_events() == 61 - seen.len() as u32);
    let newest = |is: fn(&RobotEvent) -> bool| *seen.iter().rfind(|event| is(event)).unwrap();
    let motion = newest(|event| matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog));
    assert_eq!(motion, RobotEvent::Watchdog);
    let network = newest(|event| matches!(event, RobotEvent::NetworkState(_)));
    assert_eq!(network, RobotEvent::NetworkState(NetworkState::Other(30)));
}

#[test]
fn a_calibration_ends_when_its_result_is_acknowledged_and_the_next_start_is_reported() {
    for kind in [IMU, MAG] {
        let mut robot = quiet_robot();
        robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(1));
        both_results(&mut robot, 2);
        sent(&mut robot, ms(2));
        // Of the other kind: it ends nothing.
        let acks =
            [bytes(ImuBiasAck::new(ErrorCode::Fine)), bytes(MagBiasAck::new(ErrorCode::Fine))];
        let (own, other) = if kind == IMU { (0, 1) } else { (1, 0) };
        robot.handle_input(&acks[other], ms(3));
        assert_eq!(robot.calibrating(), Some(kind));
        robot.handle_input(&acks[own], ms(4));
        assert_eq!(robot.calibrating(), None);
        events(&mut robot);
        robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(3_600_000));
        assert_eq!(events(&mut robot), [begins(kind)]);
    }
}

#[test]
fn a_stop_and_the_watchdog_are_reported_behind_a_queue_full_of_requests() {
    for is_told in [true, false] {
        let mut robot = Robot::new(RobotConfig::default(), ms(0));
        robot.handle_input(&bytes(go(60)), ms(0));
        assert_eq!(events(&mut robot), [RobotEvent::Motor(go(60))]);
        fill(&mut robot, ms(1));
        let state = SetNetworkState::new(NetworkState::from(1)).unwrap();
        robot.handle_input(&bytes(state), ms(2));
        if is_told {
            robot.handle_input(&bytes(go(0)), ms(3));
        }
        robot.handle_timeout(ms(505));
        let seen = events(&mut robot);
        assert_eq!(seen.len(), 18, "16 requests, the network, and the latest about motion");
        assert_eq!(seen.last(), Some(&RobotEvent::Watchdog));
    }
}
