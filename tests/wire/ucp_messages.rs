//! Messages: which ids and bodies are known, and the meaning of their values.
#![cfg(feature = "ucp")]

use axlewire::ucp::MessageId;

use crate::rig::*;

#[test]
fn every_id_and_body_length_is_its_message_or_unknown_and_never_misread() {
    for id in 0..=u8::MAX {
        for length in 0..=56 {
            let bytes = frame(id, 0, &vec![0; length]);
            let parsed = Frame::parse(&bytes).unwrap();
            let name = match parsed.message() {
                Message::Ping(_) => (1, 0),
                Message::Pong(_) => (1, 1),
                Message::MotorControl(_) => (2, 16),
                Message::CalibrationStart(_) => (3, 1),
                Message::CalibrationStartAck(_) => (3, 2),
                Message::CalibrationEnd(_) => (4, 1),
                Message::CalibrationEndAck(_) => (4, 2),
                Message::Report(report) => (5, if report.version().is_some() { 36 } else { 34 }),
                Message::ImuBias(_) => (6, 12),
                Message::ImuBiasAck(_) => (6, 1),
                Message::MagBias(_) => (7, 6),
                Message::MagBiasAck(_) => (7, 1),
                Message::BiasRequest(_) => (8, 0),
                Message::Biases(_) => (8, 19),
                Message::OtaRequest(_) => (9, 2),
                Message::OtaAck(_) => (9, 1),
                Message::SetNetworkState(_) => (0x0A, 1),
                Message::SetNetworkStateWide(_) => (0x0A, 4),
                Message::Unknown(raw) => {
                    assert_eq!((raw.id, raw.body), (id, &vec![0; length][..]));
                    assert!(!KNOWN.contains(&(id, length)));
                    continue;
                }
                other => panic!("{other:?}"),
            };
            assert_eq!(name, (id, length));
            assert!(KNOWN.contains(&name));
        }
    }
}

/// Ruling U4, written again independently.
#[rustfmt::skip]
const KNOWN: [(u8, usize); 19] = [
    (1, 0), (1, 1), (2, 16), (3, 1), (3, 2), (4, 1), (4, 2), (5, 36), (5, 34), (6, 12), (6, 1),
    (7, 6), (7, 1), (8, 0), (8, 19), (9, 2), (9, 1), (0x0A, 1), (0x0A, 4),
];

#[test]
fn only_the_ids_of_ruling_u4_are_known() {
    for id in 0..=u8::MAX {
        let known = MessageId::from_u8(id);
        assert_eq!(known.is_some(), (1..=10).contains(&id));
        assert!(known.is_none_or(|known| known as u8 == id));
    }
}

#[test]
fn codes_keep_unknown_values() {
    for raw in 0..=u8::MAX {
        assert_eq!(u8::from(ErrorCode::from(raw)), raw);
        assert_eq!(u8::from(CalibrationKind::from(raw)), raw);
        assert_eq!(u8::from(OtaStatus::from(raw)), raw);
        assert_eq!(u32::from(NetworkState::from(u32::from(raw))), u32::from(raw));
    }
    assert_eq!(ErrorCode::from(1), ErrorCode::Damaged);
    assert_eq!(CalibrationKind::from(2), CalibrationKind::Imu);
    assert_eq!(CalibrationKind::from(0), CalibrationKind::Other(0));
    assert_eq!(OtaStatus::from(2), OtaStatus::Forbidden);
    assert_eq!(NetworkState::from(4), NetworkState::Ota);
    assert_eq!(NetworkState::from(0x0100_0000), NetworkState::Other(0x0100_0000));
}

#[test]
fn a_network_state_is_sent_in_one_byte_or_not_at_all() {
    assert_eq!(SetNetworkState::new(NetworkState::Connected).unwrap().frame(3).as_bytes().len(), 9);
    assert_eq!(
        SetNetworkState::new(NetworkState::Other(255)).unwrap().state(),
        NetworkState::Other(255)
    );
    let error = EncodeError::NetworkState { value: 256 };
    assert_eq!(SetNetworkState::new(NetworkState::Other(256)), Err(error));
}

#[test]
fn telemetry_is_given_in_units_and_an_impossible_battery_is_flagged() {
    let telemetry = Telemetry {
        battery_pct: 87,
        acc: [16384, -8192, 0],
        gyro: [164, -1640, 0],
        voltage_dv: 119,
        current_ca: 55,
        ..Telemetry::default()
    };
    assert_eq!(telemetry.battery(), Some(87));
    assert_eq!((telemetry.volts(), telemetry.amperes()), (11.9, 0.55));
    assert_eq!(telemetry.acc_g(), [1.0, -0.5, 0.0]);
    assert_eq!(telemetry.gyro_deg_per_s(), [10.0, -100.0, 0.0]);
    for battery_pct in 0..=u16::MAX {
        let flagged = Telemetry { battery_pct, ..telemetry }.battery().is_none();
        assert_eq!(flagged, battery_pct > 100);
    }
}

#[test]
fn an_update_is_requested_only_by_an_explicit_call() {
    let frame = OtaRequest::start_firmware_update(39).frame(0);
    assert_eq!(frame.as_bytes(), [0xFD, 0xFF, 6, 0, 9, 0, 39, 0, 0x99, 0xD3]);
    assert_eq!(frame.body().version(), 39);
}

#[test]
fn only_an_unchecked_relay_passes_on_a_received_update_request() {
    let frame = OtaRequest::start_firmware_update(-2).frame(7);
    let frame = Frame::parse(frame.as_bytes()).unwrap();
    let Message::OtaRequest(received) = frame.message() else { panic!() };
    assert_eq!((received.version(), *received), (-2, OtaRequest::start_firmware_update(-2).into()));
    // `RawOtaRequest` has no `frame`: its page shows that this does not compile.
    let mut buffer = [0; 64];
    assert_eq!(frame.relay_unchecked().encode(&mut buffer).unwrap(), frame.as_bytes());
}
