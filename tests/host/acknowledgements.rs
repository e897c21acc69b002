//! Everything that a role acknowledges is available to its application, however full the queues are
//! (U15).

use crate::rig::*;

/// The answers to a host's results in `frames`.
fn acks(frames: &[Vec<u8>]) -> usize {
    frames.iter().filter(|frame| matches!(frame[4], 6 | 7)).count()
}

#[test]
fn a_result_is_acknowledged_only_when_the_application_will_find_it() {
    let mut host = quiet_host();
    sent(&mut host, ms(0));
    // Results that are never taken, each a different one, while there is room.
    let result = |value: i16| ImuBias::new([value; 3], [0; 3]);
    let mut acknowledged = Vec::new();
    for value in 0..40 {
        host.handle_input(&bytes(result(value)), ms(1));
        if acks(&sent(&mut host, ms(1))) == 1 {
            acknowledged.push(HostEvent::ImuBias(result(value)));
        }
    }
    assert!((8..20).contains(&acknowledged.len()), "{}", acknowledged.len());
    let told: Vec<_> =
        events(&mut host).into_iter().filter(|e| matches!(e, HostEvent::ImuBias(_))).collect();
    assert_eq!(told, acknowledged);
    // The robot sends the last one again, and now there is room.
    host.handle_input(&bytes(result(39)), ms(1000));
    assert_eq!(acks(&sent(&mut host, ms(1000))), 1);
    assert_eq!(events(&mut host), [HostEvent::ImuBias(result(39))]);
}

#[test]
fn a_result_that_is_refused_withdraws_the_acknowledgement_of_the_one_before() {
    let results = [
        [bytes(imu_bias()), bytes(ImuBias::new([100; 3], [200; 3]))],
        [bytes(mag_bias()), bytes(MagBias::new([100; 3]))],
    ];
    for [first, second] in results {
        // Both have arrived before the first could be acknowledged.
        let mut host = Host::with_store(quiet_config(), Picky::new(|before| before > 0), ms(0));
        host.handle_input(&[&first[..], &second].concat(), ms(1));
        assert_eq!(sent(&mut host, ms(1)), [] as [Vec<u8>; 0]);
        assert_eq!(host.statistics().results_not_stored, 1);
        // The robot resends the stored result: that one is acknowledged.
        host.handle_input(&first, ms(2));
        assert_eq!(acks(&sent(&mut host, ms(2))), 1);

        // The acknowledgement did not leave.
        for is_told_before in [true, false] {
            let mut host = Host::with_store(quiet_config(), Picky::new(|before| before > 0), ms(0));
            host.handle_input(&first, ms(1));
            assert!(host.poll_transmit(ms(1)).is_some());
            if is_told_before {
                host.handle_transmit(Unsent::Untouched, ms(2));
            }
            host.handle_input(&second, ms(3));
            if !is_told_before {
                host.handle_transmit(Unsent::Untouched, ms(4));
            }
            assert_eq!(sent(&mut host, ms(4)), [] as [Vec<u8>; 0], "{is_told_before}");
            // The indices of those that do leave have no gap.
            host.handle_input(&first, ms(5));
            assert_eq!(sent(&mut host, ms(5))[0][5], 0);
        }
    }
}

#[test]
fn reports_that_nobody_takes_out_do_not_cost_a_result() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    for turn in 0..100 {
        host.handle_timeout(ms(turn * 20));
        sent(&mut host, ms(turn * 20));
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(turn * 20));
        host.handle_input(&report(turn as u8), ms(turn * 20));
    }
    assert_eq!(host.last_report().unwrap().index, 99);
    host.handle_input(&bytes(imu_bias()), ms(2000));
    host.handle_input(&bytes(mag_bias()), ms(2000));
    host.start_calibration(IMU, ms(2000)).unwrap();
    sent(&mut host, ms(2000));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(2001));
    let seen = events(&mut host);
    assert!(seen.contains(&HostEvent::ImuBias(imu_bias())));
    assert!(seen.contains(&HostEvent::MagBias(mag_bias())));
    assert!(seen.contains(&HostEvent::CalibrationStarted(IMU)));
}

#[test]
fn biases_are_read_from_the_store_when_they_are_sent() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    sent(&mut host, ms(0));
    let newer = ImuBias::new([100; 3], [200; 3]);
    let chunk = [bytes(BiasRequest {}), bytes(newer)].concat();
    host.handle_input(&chunk, ms(1));
    let frames = sent(&mut host, ms(1));
    let biases = frames.iter().find_map(|frame| match message(frame) {
        Message::Biases(biases) => Some(*biases),
        _ => None,
    });
    assert_eq!(biases, Some(Biases::new(newer, mag_bias())));
}

#[test]
fn a_store_that_keeps_results_acknowledges_them_however_full_the_queue_is() {
    let keeps = |store: &mut dyn BiasStore| BiasStore::keeps(&store);
    let mut store = MemoryStore::default();
    assert!(store.keeps() && keeps(&mut store));
    assert!(!NoStore.keeps() && !keeps(&mut NoStore));
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    for value in 0..40 {
        let bias = ImuBias::new([value; 3], [0; 3]);
        host.handle_input(&bytes(bias), ms(1));
        assert_eq!(acks(&sent(&mut host, ms(1))), 1);
        assert_eq!(host.store().imu, Some(bias));
    }
    assert!(host.lost_events() > 0 && host.statistics().results_without_room == 0);
}

#[test]
fn a_result_without_room_is_counted_as_such_and_not_as_a_lost_event() {
    let mut host = quiet_host();
    for value in 0..40 {
        host.handle_input(&bytes(MagBias::new([value; 3])), ms(1));
    }
    let told = events(&mut host).len() as u32 - 1; // the link is up
    assert_eq!((host.statistics().results_without_room, host.lost_events()), (40 - told, 0));
}

#[test]
fn the_end_of_a_calibration_request_waits_for_room() {
    let mut host = quiet_host();
    for value in 0..40 {
        host.handle_input(&bytes(ImuBias::new([value; 3], [0; 3])), ms(1));
    }
    host.start_calibration(MAG, ms(2)).unwrap();
    sent(&mut host, ms(2));
    host.handle_input(&bytes(CalibrationStartAck::new(MAG, ErrorCode::Fine)), ms(3));
    assert_eq!(host.start_calibration(IMU, ms(3)), Err(CommandError::Calibrating));
    assert_eq!(host.start_firmware_update(50, ms(3)), Err(CommandError::Calibrating));
    assert_eq!(wait(&mut host, ms(2000)), [], "it is not repeated");
    let seen = events(&mut host);
    assert_eq!(seen.len(), 17);
    assert_eq!(seen.last(), Some(&HostEvent::CalibrationStarted(MAG)));
    host.start_calibration(IMU, ms(2001)).unwrap();
}

#[test]
fn a_result_of_either_kind_without_room_withdraws_the_acknowledgement_of_the_one_before() {
    type Result = fn(i16) -> Vec<u8>;
    let imu: Result = |value| bytes(ImuBias::new([value; 3], [0; 3]));
    let mag: Result = |value| bytes(MagBias::new([value; 3]));
    for (this, other) in [(imu, mag), (mag, imu)] {
        let mut host = quiet_host();
        // The link and 14 results: one place is left.
        for value in 0..14 {
            host.handle_input(&other(value), ms(1));
        }
        sent(&mut host, ms(1));
        host.handle_input(&this(1), ms(2));
        host.handle_input(&this(2), ms(2));
        assert_eq!(host.statistics().results_without_room, 1);
        assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
        // Once there is room, the repetition is kept and acknowledged.
        host.poll_event();
        host.handle_input(&this(2), ms(3));
        assert_eq!(sent(&mut host, ms(3)).len(), 1);
    }
}

#[test]
fn the_rest_of_an_acknowledgement_is_outdated_once_another_result_was_refused() {
    for (first, second) in [
        (bytes(imu_bias()), bytes(ImuBias::new([9; 3], [9; 3]))),
        (bytes(mag_bias()), bytes(MagBias::new([9; 3]))),
    ] {
        let mut host = Host::with_store(quiet_config(), Picky::new(|before| before == 1), ms(0));
        host.handle_input(&first, ms(1));
        while host.poll_transmit(ms(1)).is_some_and(|frame| !matches!(frame[4], 6 | 7)) {}
        assert!(!host.is_outdated());
        host.handle_input(&second, ms(1));
        assert!(host.is_outdated());
    }
}
