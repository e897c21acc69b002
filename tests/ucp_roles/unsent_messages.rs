//! Requests, results, reports and answers that did not reach the line: due again, and counted once
//! (U16).

use crate::rig::*;

#[test]
fn a_frame_that_never_left_is_not_counted_and_its_content_is_due_again() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut host = Host::with_store(HostConfig::default(), MemoryStore::default(), ms(0));
        *host.store_mut() = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
        host.handle_input(&bytes(imu_bias()), ms(1));
        host.handle_input(&bytes(mag_bias()), ms(1));
        host.handle_input(&bytes(BiasRequest {}), ms(1));
        host.start_calibration(CalibrationKind::Magnetometer, ms(1)).unwrap();
        host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
        let mut frames = Vec::new();
        // Every other frame does not reach the line.
        let mut lost = Vec::new();
        while let Some(frame) = host.poll_transmit(ms(1)).map(<[u8]>::to_vec) {
            if lost.iter().any(|other: &Vec<u8>| other[4] == frame[4]) {
                frames.push(frame);
            } else {
                host.handle_unsent(unsent, ms(1));
                lost.push(frame);
            }
            assert!(frames.len() < 40);
        }
        let ids = |frames: &[Vec<u8>]| {
            let mut ids: Vec<_> = frames.iter().map(|frame| frame[4]).collect();
            ids.sort_unstable();
            ids.dedup();
            ids
        };
        assert_eq!(ids(&lost), [1, 2, 3, 6, 7, 8, 10]);
        assert_eq!(ids(&frames), ids(&lost), "everything has been sent eventually");
        let indices: Vec<_> = frames.iter().map(|frame| frame[5]).collect();
        assert_eq!(indices, (0..frames.len() as u8).collect::<Vec<_>>(), "without a gap");
        let seen = host.statistics();
        let motor = frames.iter().filter(|frame| frame[4] == 2).count();
        assert_eq!((seen.commands as usize, seen.pings), (motor, 1));
        assert_eq!(seen.calibration_retries, 0);
        let told = events(&mut host).iter().filter(|e| **e == HostEvent::BiasesSent).count();
        assert_eq!(told, 1, "and reported once");
    }
}

#[test]
fn a_calibration_request_that_never_left_does_not_count_as_an_attempt() {
    let mut host = begun();
    host.start_calibration(IMU, ms(10)).unwrap();
    for at in 10..30 {
        let frame = host.poll_transmit(ms(at)).unwrap().to_vec();
        if speed(&frame).is_some() {
            host.poll_transmit(ms(at)).unwrap();
        }
        host.handle_unsent(Unsent::Untouched, ms(at));
    }
    let failure = wait(&mut host, ms(5000));
    assert_eq!(failure.iter().filter(|(_, frame)| frame[4] == 3).count(), 3, "three attempts left");
    assert_eq!(host.statistics().calibration_retries, 2);
}

#[test]
fn an_answer_of_a_robot_that_never_left_is_due_again() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut robot = Robot::new(RobotConfig::default(), ms(0));
        robot.set_telemetry(&Telemetry::default(), ms(0));
        robot.calibration_result_imu(imu_bias(), ms(0));
        robot.calibration_result_mag(mag_bias(), ms(0));
        robot.handle_input(&bytes(Ping {}), ms(0));
        robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(0));
        robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(0));
        robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(0));
        assert!(robot.answer_update(OtaStatus::Forbidden, ms(0)));
        let mut frames = Vec::new();
        while let Some(lost) = robot.poll_transmit(ms(0)).map(<[u8]>::to_vec) {
            robot.handle_unsent(unsent, ms(0));
            assert_eq!(robot.poll_transmit(ms(0)), Some(&lost[..]), "{unsent:?}");
            frames.push(lost);
            assert!(frames.len() <= 8);
        }
        let ids: Vec<_> = frames.iter().map(|frame| frame[4]).collect();
        assert_eq!(ids, [3, 4, 9, 1, 6, 7, 8, 5]);
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
            robot.handle_unsent(unsent, ms(20));
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
        robot.handle_unsent(unsent, ms(1000));
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
        robot.handle_unsent(unsent, ms(86));
        assert_eq!(robot.poll_transmit(ms(86)).map(|frame| frame[5]), Some(1));
        let seen = robot.statistics();
        assert_eq!((seen.reports, seen.reports_skipped), (2, 3));
        assert_eq!(robot.poll_timeout(), Some(ms(100)), "on schedule");
    }
}

#[test]
fn a_failed_flush_repeats_no_acknowledgement() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    host.handle_input(&bytes(imu_bias()), ms(1));
    host.handle_input(&bytes(BiasRequest {}), ms(1));
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    host.stop(ms(1));
    assert_eq!(sent(&mut host, ms(1)).len(), 4);
    host.handle_unsent(Unsent::Unflushed, ms(2));
    let ids: Vec<_> = sent(&mut host, ms(2)).iter().map(|frame| frame[4]).collect();
    // The robot asks again for the others.
    assert_eq!(ids, [2, 10]);
    assert_eq!(host.statistics().commands, 2, "what may have left counts");
}

#[test]
fn a_failed_flush_repeats_no_update_request_if_no_stop_can_be_lost_with_it() {
    let mut host = quiet_host();
    host.start_firmware_update(50, ms(3)).unwrap();
    assert_eq!(sent(&mut host, ms(3)).len(), 1);
    host.handle_unsent(Unsent::Unflushed, ms(4));
    assert_eq!(wait(&mut host, ms(60_000)), [], "it may have arrived");
    host.stop(ms(60_000));
    assert_eq!(speeds(&wait(&mut host, ms(60_000))), [(60_000_000, 0)]);
}

#[test]
fn an_update_request_that_never_left_is_due_again_behind_a_stop() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut host = begun();
        host.start_firmware_update(50, ms(10)).unwrap();
        assert_eq!(sent(&mut host, ms(10)).len(), 2);
        host.handle_unsent(unsent, ms(11));
        let ids: Vec<_> = sent(&mut host, ms(11)).iter().map(|frame| frame[4]).collect();
        assert_eq!(ids, if unsent == Unsent::CutOff { vec![2, 2, 9] } else { vec![2, 9] });
        assert_eq!(wait(&mut host, ms(60_000)), [], "and then silence");

        // Unless the application has changed its mind.
        let mut host = begun();
        host.start_firmware_update(50, ms(10)).unwrap();
        sent(&mut host, ms(10));
        host.stop(ms(11));
        host.handle_unsent(unsent, ms(12));
        let mut frames = wait(&mut host, ms(500)).into_iter();
        assert!(frames.all(|(_, frame)| frame[4] == 2), "{unsent:?}");
    }
}

#[test]
fn a_robot_whose_flush_failed_repeats_results_and_requests_at_once() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.calibration_result_imu(imu_bias(), ms(0));
    robot.calibration_result_mag(mag_bias(), ms(0));
    robot.handle_input(&bytes(Ping {}), ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 4);
    robot.handle_unsent(Unsent::Unflushed, ms(5));
    let ids: Vec<_> = sent(&mut robot, ms(5)).iter().map(|frame| frame[4]).collect();
    assert_eq!(ids, [6, 7, 8], "the host pings again");
}

#[test]
fn a_robot_whose_flush_failed_answers_an_update_again_and_takes_the_acknowledgement_of_its_results()
{
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    robot.calibration_result_mag(mag_bias(), ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 2);
    robot.handle_unsent(Unsent::Unflushed, ms(1));
    // They may have left all the same.
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(2));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(2));
    assert_eq!(events(&mut robot), [RobotEvent::ImuBiasTaken, RobotEvent::MagBiasTaken]);
    assert_eq!(sent(&mut robot, ms(3)), [] as [Vec<u8>; 0]);

    robot.handle_input(&bytes(OtaRequest::start_firmware_update(50)), ms(10));
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(10)));
    let answer = sent(&mut robot, ms(10));
    assert_eq!(answer.len(), 1);
    robot.handle_unsent(Unsent::Unflushed, ms(11));
    assert_eq!(sent(&mut robot, ms(11)), answer);
}

#[test]
fn an_answer_of_a_robot_that_is_cut_off_after_a_failed_flush_is_due_again() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(0));
    let lost = robot.poll_transmit(ms(0)).map(<[u8]>::to_vec).unwrap();
    assert_eq!(lost[4], 3);
    robot.handle_unsent(Unsent::Unflushed, ms(0));
    robot.handle_unsent(Unsent::CutOff, ms(1));
    assert_eq!(robot.poll_transmit(ms(1)), Some(&lost[..]));
}
