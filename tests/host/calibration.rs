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
    let mut host = starting(IMU);
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

/// A host that has asked its robot to begin a calibration.
fn starting(kind: CalibrationKind) -> Host {
    let mut host = quiet_host();
    host.start_calibration(kind, ms(0)).unwrap();
    sent(&mut host, ms(0));
    host
}

/// A host whose robot has begun a calibration.
fn calibrating(kind: CalibrationKind) -> Host {
    let mut host = starting(kind);
    let ack = CalibrationStartAck::new(kind, ErrorCode::Fine);
    host.handle_input(&bytes(ack), ms(1));
    events(&mut host);
    host
}

/// A host whose calibration of the IMU was begun, and whose next request was not answered.
fn host_after(failed: CalibrationStep) -> Host {
    let mut host = calibrating(IMU);
    match failed {
        CalibrationStep::Start => host.start_calibration(MAG, ms(2)).unwrap(),
        CalibrationStep::End => host.end_calibration(IMU, ms(2)).unwrap(),
    }
    wait(&mut host, ms(2000));
    assert_eq!(host.statistics().calibration_failures, 1);
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
fn a_repeated_result_is_acknowledged_again_and_stored_once() {
    let mut store = Picky::new(|_| false);
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
    assert_eq!(store.asked, [2, 2]);
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
        let mut host = calibrating(kind);
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
fn a_result_that_is_not_stored_is_not_acknowledged() {
    let mut host = Host::with_store(quiet_config(), Picky::new(|_| true), ms(0));
    host.handle_input(&bytes(imu_bias()), ms(1));
    host.handle_input(&bytes(mag_bias()), ms(2));
    assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
    let seen = events(&mut host);
    assert_eq!(seen[1..], [HostEvent::BiasNotStored(IMU), HostEvent::BiasNotStored(MAG)]);
    assert_eq!(host.statistics().results_not_stored, 2);
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

#[test]
fn an_acknowledgement_is_awaited_from_the_end_of_the_request_on_the_wire_to_the_microsecond() {
    // 9 bytes at 115,200 bit/s, then 200 ms.
    let wait_us = 782 + 200_000;
    for step in [CalibrationStep::Start, CalibrationStep::End] {
        let mut host = quiet_host();
        match step {
            CalibrationStep::Start => host.start_calibration(IMU, ms(3)).unwrap(),
            CalibrationStep::End => host.end_calibration(IMU, ms(3)).unwrap(),
        }
        let begin = ms(10);
        assert_eq!(sent(&mut host, begin).len(), 1);
        for attempt in 1..=3 {
            let end = begin + Duration::from_micros(wait_us * attempt);
            let just_before = us(end.as_micros() - 1);
            host.handle_timeout(just_before);
            assert_eq!(sent(&mut host, just_before), [] as [Vec<u8>; 0]);
            host.handle_timeout(end);
            assert_eq!(sent(&mut host, end).len(), usize::from(attempt < 3));
        }
        let failure = host.calibration_outcome().unwrap().unwrap_err();
        assert_eq!((failure.step, failure.attempts, failure.kind), (step, 3, IMU));
        assert_eq!(failure.cause, FailureCause::NoAnswer);
        assert_eq!(events(&mut host).pop(), Some(HostEvent::CalibrationFailed(failure)));
        host.start_calibration(IMU, ms(5000)).unwrap();
        assert_eq!(host.config().calibration_bound().as_micros(), 3 * wait_us);
    }
}

#[test]
fn each_boot_of_a_robot_is_reported_once_however_often_its_biases_are_sent() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    for boot in 1..4_u32 {
        let at = ms(u64::from(boot) * 100);
        host.handle_input(&bytes(BiasRequest {}), at);
        events(&mut host);
        assert_eq!(host.poll_transmit(at).unwrap()[4], 8);
        host.handle_transmit(Unsent::Untouched, at);
        assert_eq!(host.poll_transmit(at).unwrap()[4], 8);
        assert_eq!(events(&mut host), [HostEvent::BiasesSent]);
        assert_eq!((host.statistics().biases, host.statistics().bias_requests), (boot, boot));
    }
}

#[test]
fn the_kind_in_a_bad_acknowledgement_of_a_start_is_ignored() {
    // The vendor firmware returns the kind of the previous start there.
    for kind in [IMU, MAG, CalibrationKind::Other(0)] {
        let mut host = starting(IMU);
        let bad = CalibrationStartAck::new(kind, ErrorCode::Damaged);
        host.handle_input(&bytes(bad), ms(5));
        assert_eq!(sent(&mut host, ms(5)), [CalibrationStart::new(IMU).frame(1).as_bytes()]);
        assert_eq!(host.statistics().acks_unasked, 0);
    }
    // That of a good one is not.
    let mut host = starting(IMU);
    host.handle_input(&bytes(CalibrationStartAck::new(MAG, ErrorCode::Fine)), ms(5));
    assert_eq!((host.statistics().acks_unasked, host.calibration_outcome()), (1, None));
}

#[test]
fn a_newer_result_replaces_the_stored_one() {
    let mut host = Host::with_store(quiet_config(), MemoryStore::default(), ms(0));
    let (imu, mag) = (ImuBias::new([9; 3], [8; 3]), MagBias::new([7; 3]));
    for (at, (imu, mag)) in [(0, (imu_bias(), mag_bias())), (1, (imu, mag))] {
        host.handle_input(&bytes(imu), ms(at));
        host.handle_input(&bytes(mag), ms(at));
        assert_eq!(*host.store(), MemoryStore { imu: Some(imu), mag: Some(mag) });
    }
    sent(&mut host, ms(2));
    host.handle_input(&bytes(BiasRequest {}), ms(3));
    let answer = sent(&mut host, ms(3));
    let Message::Biases(biases) = message(&answer[0]) else { panic!("{answer:?}") };
    assert_eq!((biases.imu(), biases.mag(), biases.err()), (imu, mag, ErrorCode::Fine));
}

#[test]
fn the_outcome_of_a_calibration_request_is_unknown_while_it_is_unanswered() {
    let mut host = quiet_host();
    for err in [ErrorCode::Damaged, ErrorCode::Fine, ErrorCode::Damaged] {
        host.start_calibration(IMU, ms(0)).unwrap();
        let answers = if err == ErrorCode::Fine { 1 } else { 3 };
        for _ in 0..answers {
            assert_eq!(host.calibration_outcome(), None);
            sent(&mut host, ms(0));
            host.handle_input(&bytes(CalibrationStartAck::new(IMU, err)), ms(0));
        }
        let outcome = host.calibration_outcome().unwrap();
        assert_eq!(outcome.is_ok(), err == ErrorCode::Fine);
        events(&mut host);
    }
}
