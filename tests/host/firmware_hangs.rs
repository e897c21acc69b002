//! Ids 5..=0x0A, on which some firmware builds hang, are not sent if the settings forbid it (U14).

use crate::rig::*;

fn low_ids_host<S: BiasStore>(store: S) -> Host<S> {
    let mut config = HostConfig::default();
    config.low_ids_only = true;
    Host::with_store(config, store, ms(0))
}

#[test]
fn with_low_ids_only_no_id_from_5_to_10_is_ever_sent() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = low_ids_host(store);
    let mut ids = Vec::new();
    for turn in 0..200_u64 {
        let at = ms(turn * 20);
        host.handle_timeout(at);
        host.handle_input(&bytes(ImuBias::new([turn as i16; 3], [0; 3])), at);
        host.handle_input(&bytes(MagBias::new([turn as i16; 3])), at);
        host.handle_input(&bytes(BiasRequest {}), at);
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), at);
        let refused = host.set_network_state(NetworkState::from(turn as u32 % 5), at);
        assert_eq!(refused, Err(CommandError::LowIdsOnly { id: 0x0A }));
        let refused = host.start_firmware_update(50, at);
        assert_eq!(refused, Err(CommandError::LowIdsOnly { id: 9 }));
        let _ = host.start_calibration(IMU, at);
        let _ = host.end_calibration(MAG, at);
        let frames = sent(&mut host, at);
        host.handle_transmit(Unsent::Unflushed, at);
        ids.extend(frames.into_iter().chain(sent(&mut host, at)).map(|frame| frame[4]));
    }
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids, [1, 2, 3]);
    assert_eq!(host.store().imu, Some(ImuBias::new([199; 3], [0; 3])), "still kept");
    let error = CommandError::LowIdsOnly { id: 9 };
    assert!(error.to_string().contains("0x09"));
}

#[test]
fn with_low_ids_only_results_are_reported_once_and_bias_requests_as_not_answered() {
    let mut host = low_ids_host(NoStore);
    let mut seen = Vec::new();
    for at in [0, 1000, 2000].map(ms) {
        host.handle_input(&bytes(imu_bias()), at);
        host.handle_input(&bytes(BiasRequest {}), at);
        seen.extend(events(&mut host));
        wait(&mut host, at + Duration::from_millis(999));
    }
    let count = |event: &HostEvent| seen.iter().filter(|seen| *seen == event).count();
    assert_eq!(count(&HostEvent::ImuBias(imu_bias())), 1);
    assert_eq!(count(&HostEvent::BiasesNotAnswered), 3);
    assert_eq!(host.statistics().bias_requests, 3);
    let missing = |event: &HostEvent| matches!(event, HostEvent::BiasesMissing { .. });
    assert!(!seen.iter().any(missing));
}

/// How to recognise such a build: it answers pings until it is sent the biases.
#[test]
fn a_build_that_hangs_never_answers_the_first_ping_after_the_biases() {
    for low_ids_only in [false, true] {
        let mut config = HostConfig::default();
        config.low_ids_only = low_ids_only;
        let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
        let mut host = Host::with_store(config, store, ms(0));
        let mut hangs = false;
        for turn in 0..300 {
            let at = ms(turn * 10);
            host.handle_timeout(at);
            for frame in sent(&mut host, at) {
                hangs |= matches!(frame[4], 5..=0x0A);
                if is_ping(&frame) && !hangs {
                    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), at);
                }
            }
            if turn % 100 == 50 && !hangs {
                host.handle_input(&bytes(BiasRequest {}), at);
            }
        }
        let seen = host.statistics();
        assert_eq!((hangs, seen.biases), (!low_ids_only, u32::from(!low_ids_only)));
        assert_eq!(seen.pings_lost > 0, !low_ids_only);
        assert_eq!(host.link(), if low_ids_only { Link::Up } else { Link::Down });
    }
}
