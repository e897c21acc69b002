//! Frames that have become wrong while they are sent, acknowledgements of another kind, and results
//! that come again.

use crate::rig::*;

#[test]
fn only_a_command_that_moves_the_robot_can_be_outdated_and_only_by_another() {
    let mut host = begun();
    assert!(!host.is_outdated());
    host.drive(go(50), ms(100)).unwrap();
    assert_eq!(speed(host.poll_transmit(ms(100)).unwrap()), Some(50));
    assert!(!host.is_outdated());
    host.drive(go(50), ms(101)).unwrap();
    assert!(!host.is_outdated(), "the same again");
    host.drive(go(51), ms(102)).unwrap();
    assert!(host.is_outdated());
    host.stop(ms(103));
    assert!(host.is_outdated());
    // A stop is right whatever comes after it.
    assert_eq!(speed(host.poll_transmit(ms(103)).unwrap()), Some(0));
    host.drive(go(50), ms(104)).unwrap();
    assert!(!host.is_outdated());
    // Nothing else moves.
    host.set_network_state(NetworkState::Connected, ms(104)).unwrap();
    assert_eq!(host.poll_transmit(ms(104)).unwrap()[4], 10);
    host.stop(ms(105));
    assert!(!host.is_outdated());
}

#[test]
fn a_command_that_the_dead_man_has_ended_is_outdated() {
    let mut host = begun();
    host.drive(go(50), ms(0)).unwrap();
    wait(&mut host, ms(499));
    assert!(!host.is_outdated());
    host.handle_timeout(ms(500));
    assert!(host.is_outdated());
}

#[test]
fn the_kind_in_a_bad_acknowledgement_of_a_start_is_ignored() {
    // The vendor firmware returns the kind of the previous start there.
    for kind in [IMU, MAG, CalibrationKind::Other(0)] {
        let mut host = quiet_host();
        host.start_calibration(IMU, ms(0)).unwrap();
        sent(&mut host, ms(0));
        let bad = CalibrationStartAck::new(kind, ErrorCode::Damaged);
        host.handle_input(&bytes(bad), ms(5));
        assert_eq!(sent(&mut host, ms(5)), [CalibrationStart::new(IMU).frame(1).as_bytes()]);
        assert_eq!(host.statistics().acks_unasked, 0);
    }
    // That of a good one is not.
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
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

/// Refuses the first result of each kind.
#[derive(Default)]
struct Shy(MemoryStore, u8, u8);

impl BiasStore for Shy {
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        self.0.load()
    }
    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        self.1 += 1;
        if self.1 == 1 { Err(NotStored) } else { self.0.store_imu(bias) }
    }
    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        self.2 += 1;
        if self.2 == 1 { Err(NotStored) } else { self.0.store_mag(bias) }
    }
}

#[test]
fn the_acknowledgement_of_a_result_that_was_refused_before_is_due_again_if_it_did_not_leave() {
    for (kind, result) in [(IMU, bytes(imu_bias())), (MAG, bytes(mag_bias()))] {
        let mut host = Host::with_store(quiet_config(), Shy::default(), ms(0));
        host.handle_input(&result, ms(1));
        assert_eq!(sent(&mut host, ms(1)), [] as [Vec<u8>; 0]);
        assert!(events(&mut host).contains(&HostEvent::BiasNotStored(kind)));
        host.handle_input(&result, ms(1001));
        let acknowledgement = host.poll_transmit(ms(1001)).unwrap().to_vec();
        host.handle_unsent(Unsent::Untouched, ms(1001));
        assert_eq!(sent(&mut host, ms(1002)), [acknowledgement]);
    }
}
