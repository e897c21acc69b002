//! Requests and answers that did not reach the line: due again, and counted once (U16).

use crate::{firmware_update::asked, rig::*};

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
                host.handle_transmit(unsent, ms(1));
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
        host.handle_transmit(Unsent::Untouched, ms(at));
    }
    let failure = wait(&mut host, ms(5000));
    assert_eq!(failure.iter().filter(|(_, frame)| frame[4] == 3).count(), 3, "three attempts left");
    assert_eq!(host.statistics().calibration_retries, 2);
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
    host.handle_transmit(Unsent::Unflushed, ms(2));
    // The robot asks again for the others.
    assert_eq!(ids(&sent(&mut host, ms(2))), [2, 2, 10]);
    assert_eq!(host.statistics().commands, 3, "what may have left counts");
}

#[test]
fn a_stop_between_the_two_copies_of_a_command_is_sent_twice_itself() {
    let mut host = driven(begun(), 50, 30);
    sent(&mut host, ms(30));
    host.handle_transmit(Unsent::Unflushed, ms(31));
    assert_eq!(host.poll_transmit(ms(31)).and_then(speed), Some(50));
    host.stop(ms(32));
    assert_eq!(host.poll_transmit(ms(32)).and_then(speed), Some(0));
    assert!(!host.is_stop_sent(), "one copy may be lost (U16)");
    assert_eq!(host.poll_transmit(ms(32)).and_then(speed), Some(0));
    assert!(host.is_stop_sent());
}

#[test]
fn the_acknowledgement_of_a_result_that_was_refused_before_is_due_again_if_it_did_not_leave() {
    for (kind, result) in [(IMU, bytes(imu_bias())), (MAG, bytes(mag_bias()))] {
        let mut host = Host::with_store(quiet_config(), Picky::new(|before| before == 0), ms(0));
        host.handle_input(&result, ms(1));
        assert_eq!(sent(&mut host, ms(1)), [] as [Vec<u8>; 0]);
        assert!(events(&mut host).contains(&HostEvent::BiasNotStored(kind)));
        host.handle_input(&result, ms(1001));
        let acknowledgement = host.poll_transmit(ms(1001)).unwrap().to_vec();
        host.handle_transmit(Unsent::Untouched, ms(1001));
        assert_eq!(sent(&mut host, ms(1002)), [acknowledgement]);
    }
}

#[test]
fn a_calibration_request_that_its_port_does_not_take_is_given_up_at_its_bound() {
    let mut host = begun();
    host.start_calibration(IMU, ms(100)).unwrap();
    let mut at = ms(100);
    while host.calibration_outcome().is_none() {
        host.handle_timeout(at);
        while let Some(frame) = host.poll_transmit(at) {
            let is_request = frame[4] == 3;
            if is_request {
                host.handle_transmit(Unsent::Untouched, at);
                break;
            }
        }
        at += Duration::from_millis(1);
    }
    let bound = host.config().calibration_bound();
    assert!(at - ms(100) <= bound + Duration::from_millis(2), "{at:?}");
    let failure = host.calibration_outcome().unwrap().unwrap_err();
    assert_eq!((failure.attempts, failure.cause), (0, FailureCause::NoAnswer));
    assert!(wait(&mut host, ms(60_000)).iter().all(|(_, frame)| frame[4] == 2), "and not sent");
    // The time before its first attempt does not count.
    host.start_calibration(IMU, ms(60_000)).unwrap();
    assert!(wait(&mut host, ms(61_000)).iter().any(|(_, frame)| frame[4] == 3));
}

#[test]
fn a_frame_that_was_taken_whole_but_with_a_pause_may_have_arrived() {
    // The request of an update: silence follows.
    let (mut host, now) = asked();
    sent(&mut host, now);
    host.handle_transmit(Transmit::Taken, now);
    host.handle_transmit(Unsent::CutOff, now);
    assert_eq!(wait(&mut host, ms(60_000)), []);
    // That of a calibration: it counts as an attempt.
    let mut host = begun();
    host.start_calibration(IMU, ms(100)).unwrap();
    let (mut requests, mut at) = (0, ms(100));
    while host.calibration_outcome().is_none() {
        host.handle_timeout(at);
        while let Some(frame) = host.poll_transmit(at) {
            if frame[4] == 3 {
                requests += 1;
                host.handle_transmit(Transmit::Taken, at);
                host.handle_transmit(Unsent::CutOff, at);
            }
        }
        at += Duration::from_millis(1);
        assert!(at < ms(1000));
    }
    assert_eq!(requests, 3);
}
