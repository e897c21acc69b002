//! Calibrations end with biases in the store, and each request is acknowledged or fails in time
//! (U11).

use crate::rig::*;

#[test]
fn a_calibration_ends_with_biases_in_the_store() {
    let mut rig = Rig::new(ms(0));
    rig.run_for(100);
    rig.host.start_calibration(IMU, rig.now).unwrap();
    assert_eq!(rig.host.start_calibration(MAG, rig.now), Err(CommandError::Calibrating));
    rig.run_for(100);
    assert_eq!(rig.robot_has_seen(&begins(IMU)), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationStarted(IMU)), 1);
    rig.host.end_calibration(IMU, rig.now).unwrap();
    rig.run_for(100);
    assert_eq!(rig.robot_has_seen(&RobotEvent::CalibrationEnd(IMU)), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationEnded(IMU)), 1);
    rig.robot.calibration_result_imu(imu_bias(), rig.now);
    rig.run_for(3000);
    assert_eq!(rig.host_has_seen(&HostEvent::ImuBias(imu_bias())), 1);
    assert_eq!(rig.robot_has_seen(&RobotEvent::ImuBiasTaken), 1);
    assert_eq!(rig.host.store().imu, Some(imu_bias()));
    assert_eq!(rig.robot.statistics().results, 1, "acknowledged at once, not repeated");
    assert_eq!(rig.host.statistics().calibration_retries, 0);
}

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
fn a_lost_acknowledgement_is_requested_again() {
    let mut rig = Rig::new(ms(0));
    let mut lost = 0;
    rig.fault = Box::new(move |_, frame| {
        let is_ack = matches!(message(frame), Message::CalibrationStartAck(_));
        if is_ack && lost < 2 {
            lost += 1;
            return Vec::new();
        }
        frame.to_vec()
    });
    rig.host.start_calibration(MAG, rig.now).unwrap();
    rig.run_for(1000);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationStarted(MAG)), 1);
    assert_eq!(rig.robot_has_seen(&begins(MAG)), 1);
    assert_eq!(rig.host.statistics().calibration_retries, 2);
}

#[test]
fn an_unanswered_calibration_request_fails_within_its_bound() {
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let bound = HostConfig::default().calibration_bound();
    assert_eq!(bound.as_micros(), 3 * (200_000 + 782));
    let retries = wait(&mut host, ms(0) + bound);
    assert_eq!(retries.len(), 2);
    let event = events(&mut host).pop().unwrap();
    let HostEvent::CalibrationFailed(failure) = event else { panic!("{event:?}") };
    assert_eq!((failure.step, failure.kind), (CalibrationStep::Start, IMU));
    assert_eq!((failure.cause, failure.attempts), (FailureCause::NoAnswer, 3));
    assert_eq!(host.statistics().calibration_failures, 1);
    host.start_calibration(IMU, ms(5000)).unwrap();
}

#[test]
fn a_calibration_request_that_arrives_damaged_is_resent_at_once_and_eventually_fails() {
    let mut host = quiet_host();
    host.end_calibration(IMU, ms(0)).unwrap();
    for at in [0, 1, 2] {
        assert_eq!(sent(&mut host, ms(at)).len(), 1);
        // Shipped robots report an old kind here.
        let ack = CalibrationEndAck::new(MAG, ErrorCode::Damaged);
        host.handle_input(&bytes(ack), ms(at + 1));
    }
    let Some(HostEvent::CalibrationFailed(failure)) = events(&mut host).pop() else { panic!() };
    assert_eq!(failure.cause, FailureCause::Refused(ErrorCode::Damaged));
    assert_eq!(failure.step, CalibrationStep::End);
    assert_eq!(sent(&mut host, ms(3)), [] as [Vec<u8>; 0]);
}

#[test]
fn the_cause_of_a_failure_is_that_of_the_last_attempt() {
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let ack = CalibrationStartAck::new(IMU, ErrorCode::Damaged);
    host.handle_input(&bytes(ack), ms(1));
    assert_eq!(wait(&mut host, ms(1000)).len(), 2);
    let failure = events(&mut host).into_iter().find_map(|event| match event {
        HostEvent::CalibrationFailed(failure) => Some(failure),
        _ => None,
    });
    assert_eq!(failure.unwrap().cause, FailureCause::NoAnswer);
}

#[test]
fn an_end_is_acknowledged_with_any_kind_as_long_as_the_robots_last_start_is_not_known() {
    let mut host = quiet_host();
    host.end_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let ack = CalibrationEndAck::new(CalibrationKind::Other(0), ErrorCode::Fine);
    host.handle_input(&bytes(ack), ms(1));
    assert_eq!(events(&mut host).pop(), Some(HostEvent::CalibrationEnded(IMU)));
}

/// A host whose calibration of the IMU was begun, and whose next request was not answered.
fn host_after(failed: CalibrationStep) -> Host {
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(1));
    match failed {
        CalibrationStep::Start => host.start_calibration(MAG, ms(2)).unwrap(),
        CalibrationStep::End => host.end_calibration(IMU, ms(2)).unwrap(),
    }
    wait(&mut host, ms(2000));
    let failures = host.statistics().calibration_failures;
    assert_eq!((failures, events(&mut host).len() > 1), (1, true));
    host.end_calibration(IMU, ms(2001)).unwrap();
    sent(&mut host, ms(2001));
    host
}

#[test]
fn an_unanswered_start_may_have_begun_its_kind_and_an_unanswered_end_changes_nothing() {
    let ack = bytes(CalibrationEndAck::new(MAG, ErrorCode::Fine));
    let mut host = host_after(CalibrationStep::Start);
    host.handle_input(&ack, ms(2002));
    assert_eq!(events(&mut host).pop(), Some(HostEvent::CalibrationEnded(IMU)));

    let mut host = host_after(CalibrationStep::End);
    let before = host.statistics().acks_unasked;
    host.handle_input(&ack, ms(2002));
    assert_eq!(host.statistics().acks_unasked, before + 1, "the IMU calibration was the one begun");
}

#[test]
fn unexpected_acknowledgements_are_counted() {
    let mut host = quiet_host();
    let ack = bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine));
    host.handle_input(&ack, ms(0)); // nothing was asked
    host.start_calibration(MAG, ms(1)).unwrap();
    let early = bytes(CalibrationStartAck::new(MAG, ErrorCode::Fine));
    host.handle_input(&early, ms(1)); // not sent yet
    sent(&mut host, ms(1));
    host.handle_input(&ack, ms(2)); // another kind
    host.handle_input(&bytes(CalibrationEndAck::new(MAG, ErrorCode::Fine)), ms(3));
    assert_eq!(host.statistics().acks_unasked, 4);
    assert_eq!(events(&mut host), [HostEvent::LinkUp]);
    let unknown = host.start_calibration(CalibrationKind::Other(7), ms(4));
    assert_eq!(unknown, Err(CommandError::Calibrating));
}

#[test]
fn a_calibration_of_unknown_kind_is_refused() {
    let mut host = quiet_host();
    let refused = host.start_calibration(CalibrationKind::Other(7), ms(0));
    assert_eq!(refused, Err(CommandError::CalibrationKind { kind: 7 }));
    assert_eq!(sent(&mut host, ms(0)), [] as [Vec<u8>; 0]);
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
fn a_repeated_result_is_acknowledged_again_and_stored_once() {
    struct Counting(MemoryStore, u32);
    impl BiasStore for Counting {
        fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
            self.0.load()
        }
        fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
            self.1 += 1;
            self.0.store_imu(bias)
        }
        fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
            self.1 += 1;
            self.0.store_mag(bias)
        }
    }
    let mut store = Counting(MemoryStore::default(), 0);
    let mut host = Host::with_store(quiet_config(), &mut store, ms(0));
    for at in [0, 1000, 2000] {
        host.handle_input(&bytes(mag_bias()), ms(at));
        host.handle_timeout(ms(at));
        let acks = sent(&mut host, ms(at));
        assert!(matches!(message(&acks[0]), Message::MagBiasAck(_)));
        wait(&mut host, ms(at + 999));
    }
    assert_eq!(host.statistics().results_repeated, 2);
    // The same result of a new calibration is a new one.
    host.start_calibration(MAG, ms(3000)).unwrap();
    host.handle_input(&bytes(mag_bias()), ms(3001));
    assert_eq!(host.statistics().results_repeated, 2);
    wait(&mut host, ms(4000));
    host.handle_input(&bytes(imu_bias()), ms(4000));
    host.start_calibration(IMU, ms(4001)).unwrap();
    host.handle_input(&bytes(imu_bias()), ms(4002));
    assert_eq!(host.statistics().results_repeated, 2);
    assert_eq!(store.1, 4);
}

#[test]
fn neither_a_refused_start_nor_one_of_the_other_kind_makes_a_result_new() {
    for (kind, other, result) in [(IMU, MAG, bytes(imu_bias())), (MAG, IMU, bytes(mag_bias()))] {
        let mut host = quiet_host();
        host.handle_input(&result, ms(0));
        assert_eq!(events(&mut host).len(), 2, "the link, and the result");
        host.start_calibration(other, ms(10)).unwrap();
        host.handle_input(&result, ms(20));
        assert_eq!(host.start_calibration(kind, ms(30)), Err(CommandError::Calibrating));
        host.handle_input(&result, ms(40));
        assert_eq!(events(&mut host), []);
        assert_eq!(host.statistics().results_repeated, 2);
    }
}

#[test]
fn a_result_is_reported_once_even_if_the_end_is_requested_before_it_is_repeated() {
    for (kind, result) in [(IMU, bytes(imu_bias())), (MAG, bytes(mag_bias()))] {
        let mut host = quiet_host();
        host.start_calibration(kind, ms(0)).unwrap();
        sent(&mut host, ms(0));
        let ack = CalibrationStartAck::new(kind, ErrorCode::Fine);
        host.handle_input(&bytes(ack), ms(5));
        events(&mut host);
        host.handle_input(&result, ms(100));
        sent(&mut host, ms(100)); // the acknowledgement is lost on the line
        assert_eq!(events(&mut host).len(), 1);
        host.end_calibration(kind, ms(200)).unwrap();
        sent(&mut host, ms(200));
        host.handle_input(&result, ms(300));
        assert_eq!(events(&mut host), []);
        assert_eq!(host.statistics().results_repeated, 1);
        assert!(sent(&mut host, ms(300)).iter().any(|frame| matches!(frame[4], 6 | 7)));
    }
}

/// A host whose robot has begun a calibration.
fn calibrating(kind: CalibrationKind) -> Host {
    let mut host = quiet_host();
    host.start_calibration(kind, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let ack = CalibrationStartAck::new(kind, ErrorCode::Fine);
    host.handle_input(&bytes(ack), ms(1));
    events(&mut host);
    host
}

#[test]
fn the_acknowledgement_of_an_end_names_the_requested_kind_or_that_of_the_last_start() {
    for (asked, told, counts) in [
        (MAG, MAG, true),
        (IMU, IMU, true),
        (IMU, MAG, true), // as shipped robots report it
        (MAG, IMU, false),
        (MAG, CalibrationKind::Other(0), false),
    ] {
        let mut host = calibrating(MAG);
        host.end_calibration(asked, ms(2)).unwrap();
        sent(&mut host, ms(2));
        for err in [ErrorCode::Damaged, ErrorCode::Fine] {
            let ack = CalibrationEndAck::new(told, err);
            host.handle_input(&bytes(ack), ms(3));
            assert_eq!(sent(&mut host, ms(3)).len(), usize::from(counts && err != ErrorCode::Fine));
        }
        let ended = [HostEvent::CalibrationEnded(asked)];
        assert_eq!(events(&mut host), &ended[..usize::from(counts)], "{asked:?} {told:?}");
        assert_eq!(host.statistics().acks_unasked, if counts { 0 } else { 2 });
    }
}

#[test]
fn after_a_start_that_may_have_arrived_any_kind_acknowledges_an_end() {
    let mut host = calibrating(MAG);
    host.start_calibration(IMU, ms(2)).unwrap();
    sent(&mut host, ms(2));
    wait(&mut host, ms(1000));
    assert!(matches!(host.calibration_outcome(), Some(Err(_))));
    events(&mut host);
    host.end_calibration(IMU, ms(1000)).unwrap();
    sent(&mut host, ms(1000));
    host.handle_input(&bytes(CalibrationEndAck::new(MAG, ErrorCode::Fine)), ms(1001));
    assert_eq!(events(&mut host).pop(), Some(HostEvent::CalibrationEnded(IMU)));
}

#[test]
fn a_result_that_is_not_stored_is_not_acknowledged() {
    struct Full;
    impl BiasStore for Full {
        fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
            (None, None)
        }
        fn store_imu(&mut self, _: ImuBias) -> Result<(), NotStored> {
            Err(NotStored)
        }
        fn store_mag(&mut self, _: MagBias) -> Result<(), NotStored> {
            Err(NotStored)
        }
    }
    let mut host = Host::with_store(quiet_config(), Full, ms(0));
    host.handle_input(&bytes(imu_bias()), ms(1));
    host.handle_input(&bytes(mag_bias()), ms(2));
    assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
    let seen = events(&mut host);
    assert_eq!(seen[1..], [HostEvent::BiasNotStored(IMU), HostEvent::BiasNotStored(MAG)]);
    assert_eq!(host.statistics().results_not_stored, 2);
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

#[test]
fn the_robots_boot_request_is_answered_only_if_all_biases_are_stored() {
    let mut rig = Rig::new(ms(0));
    rig.host.store_mut().imu = Some(imu_bias());
    rig.run_for(2500);
    let missing = HostEvent::BiasesMissing { imu: false, mag: true };
    assert_eq!(rig.host_has_seen(&missing), 3);
    let biases = |event: &RobotEvent| matches!(event, RobotEvent::Biases(_));
    assert!(!rig.robot_events.iter().any(|(_, event)| biases(event)));
    rig.host.store_mut().mag = Some(mag_bias());
    rig.run_for(5000);
    assert_eq!(rig.robot_has_seen(&RobotEvent::Biases(Biases::new(imu_bias(), mag_bias()))), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::BiasesSent), 1);
    assert_eq!(rig.robot.statistics().bias_requests, 4);
}

#[test]
fn a_host_without_a_store_passes_results_on_as_events() {
    let mut rig = Rig::of(Host::new(HostConfig::default(), ms(0)), quiet_robot(), ms(0));
    rig.robot.calibration_result_mag(mag_bias(), rig.now);
    rig.run_for(2000);
    assert_eq!(rig.host_has_seen(&HostEvent::MagBias(mag_bias())), 1);
    assert_eq!(rig.robot_has_seen(&RobotEvent::MagBiasTaken), 1);
    assert_eq!(*rig.host.store(), NoStore);
}
