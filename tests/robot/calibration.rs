//! Calibrations and their results (U11).

use crate::rig::*;

#[test]
fn calibration_requests_are_acknowledged_at_once() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(CalibrationStart::new(MAG)), ms(1));
    let ack = CalibrationStartAck::new(MAG, ErrorCode::Fine);
    assert_eq!(sent(&mut robot, ms(1)), [bytes(ack)]);
    robot.handle_input(&bytes(CalibrationEnd::new(MAG)), ms(2));
    let ack = CalibrationEndAck::new(MAG, ErrorCode::Fine);
    assert_eq!(sent(&mut robot, ms(2)), [bytes(ack)]);
    let both = [begins(MAG), RobotEvent::CalibrationEnd(MAG)];
    assert_eq!(events(&mut robot), both);
}

#[test]
fn a_repeated_calibration_request_is_acknowledged_without_an_event() {
    let mut robot = quiet_robot();
    for (at, request) in [
        (1, bytes(CalibrationStart::new(MAG))),
        (2, bytes(CalibrationStart::new(MAG))),
        (3, bytes(CalibrationEnd::new(MAG))),
        (4, bytes(CalibrationEnd::new(MAG))),
        (5, bytes(CalibrationStart::new(CalibrationKind::Other(0)))),
    ] {
        robot.handle_input(&request, ms(at));
        assert_eq!(sent(&mut robot, ms(at)).len(), 1);
    }
    assert_eq!(events(&mut robot).len(), 2);
    assert_eq!(
        (robot.statistics().calibration_repeats, robot.statistics().calibration_refused),
        (1, 2)
    );
    assert_eq!(robot.calibrating(), None);
}

#[test]
fn results_are_repeated_every_1000_ms_until_acknowledged() {
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    robot.calibration_result_mag(mag_bias(), ms(300));
    assert_eq!(sent(&mut robot, ms(300)), [bytes(imu_bias()), bytes(mag_bias())]);
    let times: Vec<_> = wait(&mut robot, ms(3400)).iter().map(|(at, _)| at.as_micros()).collect();
    assert_eq!(times, [1_300_000, 1_300_000, 2_300_000, 2_300_000, 3_300_000, 3_300_000]);
    // An acknowledgement with `Damaged` does not end it.
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Damaged)), ms(3500));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Damaged)), ms(3500));
    assert_eq!(events(&mut robot), []);
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(3500));
    assert_eq!(events(&mut robot), [RobotEvent::MagBiasTaken]);
    assert_eq!(wait(&mut robot, ms(5000)).len(), 1);
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(5000));
    assert_eq!(events(&mut robot), [RobotEvent::ImuBiasTaken]);
    assert_eq!(robot.poll_timeout(), None, "nothing more is due");
    assert_eq!(robot.statistics().acks_refused, 2);
}

#[test]
fn biases_are_requested_every_1000_ms_from_boot_until_answered() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    assert_eq!(sent(&mut robot, ms(0)), [bytes(BiasRequest {})]);
    let times: Vec<_> = wait(&mut robot, ms(3500)).iter().map(|(at, _)| at.as_micros()).collect();
    assert_eq!(times, [1_000_000, 2_000_000, 3_000_000]);
    let biases = Biases::new(imu_bias(), mag_bias());
    robot.handle_input(&bytes(biases), ms(3600));
    assert_eq!(events(&mut robot), [RobotEvent::Biases(biases)]);
    assert_eq!(robot.poll_timeout(), None);
    assert_eq!(sent(&mut quiet_robot(), ms(0)), [] as [Vec<u8>; 0], "can be switched off");
}
