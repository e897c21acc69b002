//! Results, reports and answers that did not reach the line: due again, and counted once (U16).

use crate::rig::*;

#[test]
fn an_answer_of_a_robot_that_never_left_is_due_again() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut robot = Robot::new(RobotConfig::default(), ms(0));
        robot.set_telemetry(&Telemetry::default(), ms(0));
        both_results(&mut robot, 0);
        robot.handle_input(&bytes(Ping {}), ms(0));
        robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(0));
        robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(0));
        robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(0));
        assert!(robot.answer_update(OtaStatus::Forbidden, ms(0)));
        let mut frames = Vec::new();
        while let Some(lost) = robot.poll_transmit(ms(0)).map(<[u8]>::to_vec) {
            robot.handle_transmit(unsent, ms(0));
            assert_eq!(robot.poll_transmit(ms(0)), Some(&lost[..]), "{unsent:?}");
            frames.push(lost);
            assert!(frames.len() <= 8);
        }
        assert_eq!(ids(&frames), [3, 4, 9, 1, 6, 7, 8, 5]);
        let seen = robot.statistics();
        assert_eq!((seen.pongs, seen.results, seen.bias_requests, seen.reports), (1, 2, 1, 1));
        // The next report: on schedule, with the next index.
        assert_eq!(wait(&mut robot, ms(20))[0].1[5], 1);
        assert_eq!(robot.statistics().reports_skipped, 0);
    }
}

#[test]
fn a_result_that_never_left_is_not_ended_by_the_acknowledgement_of_the_one_before() {
    type Begin = fn(&mut Robot, i16, Instant);
    let results: [(Begin, _, _); 2] = [
        (
            |robot, value, now| robot.calibration_result_imu(ImuBias::new([value; 3], [0; 3]), now),
            bytes(ImuBiasAck::new(ErrorCode::Fine)),
            RobotEvent::ImuBiasTaken,
        ),
        (
            |robot, value, now| robot.calibration_result_mag(MagBias::new([value; 3]), now),
            bytes(MagBiasAck::new(ErrorCode::Fine)),
            RobotEvent::MagBiasTaken,
        ),
    ];
    for (begin, ack, taken) in results {
        for unsent in [Unsent::Untouched, Unsent::CutOff] {
            let mut robot = quiet_robot();
            begin(&mut robot, 1, ms(10));
            assert_eq!(sent(&mut robot, ms(10)).len(), 1);
            begin(&mut robot, 2, ms(20));
            assert!(robot.poll_transmit(ms(20)).is_some());
            robot.handle_transmit(unsent, ms(20));
            robot.handle_input(&ack, ms(21)); // acknowledges the first
            assert_eq!(events(&mut robot), [], "{unsent:?}");
            assert_eq!(robot.statistics().acks_refused, 1);
            assert_eq!(sent(&mut robot, ms(22)).len(), 1);
            robot.handle_input(&ack, ms(23));
            assert_eq!(events(&mut robot), [taken]);
        }
    }
}

#[test]
fn a_repetition_that_did_not_leave_leaves_the_result_sent() {
    for unsent in EVERY {
        let mut robot = quiet_robot();
        robot.calibration_result_imu(imu_bias(), ms(0));
        sent(&mut robot, ms(0));
        assert!(robot.poll_transmit(ms(1000)).is_some());
        robot.handle_transmit(unsent, ms(1000));
        robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(1001));
        assert_eq!(events(&mut robot), [RobotEvent::ImuBiasTaken], "{unsent:?}");
    }
}

#[test]
fn skipped_reports_are_counted_once_even_if_the_next_did_not_leave() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut robot = quiet_robot();
        robot.set_telemetry(&Telemetry::default(), ms(0));
        sent(&mut robot, ms(0));
        assert_eq!(robot.poll_transmit(ms(85)).map(|frame| frame[5]), Some(1));
        robot.handle_transmit(unsent, ms(86));
        assert_eq!(robot.poll_transmit(ms(86)).map(|frame| frame[5]), Some(1));
        let seen = robot.statistics();
        assert_eq!((seen.reports, seen.reports_skipped), (2, 3));
        assert_eq!(robot.poll_timeout(), Some(ms(100)), "on schedule");
    }
}

#[test]
fn a_robot_whose_flush_failed_repeats_results_and_requests_at_once() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    both_results(&mut robot, 0);
    robot.handle_input(&bytes(Ping {}), ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 4);
    robot.handle_transmit(Unsent::Unflushed, ms(5));
    assert_eq!(ids(&sent(&mut robot, ms(5))), [6, 7, 8], "the host pings again");
}

#[test]
fn a_robot_whose_flush_failed_answers_an_update_again_and_takes_the_acknowledgement_of_its_results()
{
    let mut robot = quiet_robot();
    both_results(&mut robot, 0);
    assert_eq!(sent(&mut robot, ms(0)).len(), 2);
    robot.handle_transmit(Unsent::Unflushed, ms(1));
    // They may have left all the same.
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(2));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(2));
    assert_eq!(events(&mut robot), [RobotEvent::ImuBiasTaken, RobotEvent::MagBiasTaken]);
    assert_eq!(sent(&mut robot, ms(3)), [] as [Vec<u8>; 0]);

    robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(10));
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(10)));
    let answer = sent(&mut robot, ms(10));
    assert_eq!(answer.len(), 1);
    robot.handle_transmit(Unsent::Unflushed, ms(11));
    assert_eq!(sent(&mut robot, ms(11)), answer);
}

#[test]
fn an_answer_of_a_robot_that_is_cut_off_after_a_failed_flush_is_due_again() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(0));
    let lost = robot.poll_transmit(ms(0)).map(<[u8]>::to_vec).unwrap();
    assert_eq!(lost[4], 3);
    robot.handle_transmit(Unsent::Unflushed, ms(0));
    robot.handle_transmit(Unsent::CutOff, ms(1));
    assert_eq!(robot.poll_transmit(ms(1)), Some(&lost[..]));
}

#[test]
fn an_answer_to_an_update_request_that_did_not_leave_does_not_replace_a_newer_one() {
    let asks = bytes(OtaRequest::start_firmware_update(50));
    for unsent in EVERY {
        let mut robot = quiet_robot();
        robot.handle_input(&asks, ms(0));
        assert!(robot.answer_update(OtaStatus::Failed, ms(0)));
        assert!(!robot.answer_update(OtaStatus::Failed, ms(0)), "answered");
        robot.poll_transmit(ms(0)).unwrap();
        robot.handle_input(&asks, ms(1));
        assert!(robot.answer_update(OtaStatus::Forbidden, ms(1)));
        robot.handle_transmit(unsent, ms(1));
        assert_eq!(sent(&mut robot, ms(1)), [bytes(OtaAck::new(OtaStatus::Forbidden))]);
    }
}

#[test]
fn an_answer_to_an_update_that_has_been_flushed_is_not_sent_again_for_a_port_that_is_replaced() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(0));
    events(&mut robot);
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(1)));
    assert_eq!(sent(&mut robot, ms(1)).len(), 1);
    robot.handle_transmit(Transmit::Taken, ms(1));
    robot.handle_transmit(Transmit::Flushed, ms(1));
    for unsent in [Unsent::Unflushed, Unsent::Untouched] {
        robot.handle_transmit(unsent, ms(2));
        assert_eq!(sent(&mut robot, ms(2)), [] as [Vec<u8>; 0]);
    }
}

#[test]
fn an_answer_to_an_update_that_shares_a_failed_flush_with_later_frames_is_sent_again() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(0));
    events(&mut robot);
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(1)));
    robot.handle_input(&bytes(Ping {}), ms(1));
    let frames = sent(&mut robot, ms(1));
    assert!(frames.len() >= 2 && frames[0][4] == 9, "{frames:?}");
    robot.handle_transmit(Unsent::Unflushed, ms(2));
    let again: Vec<_> = sent(&mut robot, ms(2)).into_iter().filter(|frame| frame[4] == 9).collect();
    assert_eq!(again, [frames[0].clone()]);
    // Not because of a flush long after it, by a driver that does not tell of flushes.
    robot.handle_transmit(Unsent::Unflushed, ms(5000));
    assert!(sent(&mut robot, ms(5000)).iter().all(|frame| frame[4] != 9));
}
