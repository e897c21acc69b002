//! UCP messages and frames: what is read, what is built, and what is refused.

#![cfg(feature = "ucp")]

use axlewire::{
    crc16,
    error::{EncodeError, ParseError},
    stream::{Encode, Event, Frames, Reason},
    ucp::{
        Body, CalibrationKind, CalibrationStart, ErrorCode, Frame, FrameOf, Header, Message,
        MessageId, MotorControl, NetworkState, OtaRequest, OtaStatus, Ping, Pong, RawFrame,
        RawMotorControl, SetNetworkState, Telemetry, Ucp,
    },
};

/// A frame by hand, with any id and any body.
fn frame(id: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF];
    frame.extend((body.len() as u16 + 4).to_le_bytes());
    frame.extend([id, 0]);
    frame.extend(body);
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}

#[test]
fn every_id_and_body_length_is_its_message_or_unknown_and_never_misread() {
    for id in 0..=u8::MAX {
        for length in 0..=56 {
            let bytes = frame(id, &vec![0; length]);
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

/// Ruling U4, written down a second time.
const KNOWN: [(u8, usize); 19] = [
    (1, 0),
    (1, 1),
    (2, 16),
    (3, 1),
    (3, 2),
    (4, 1),
    (4, 2),
    (5, 36),
    (5, 34),
    (6, 12),
    (6, 1),
    (7, 6),
    (7, 1),
    (8, 0),
    (8, 19),
    (9, 2),
    (9, 1),
    (0x0A, 1),
    (0x0A, 4),
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
fn a_speed_or_turn_out_of_range_is_an_error_with_the_value_and_the_limits() {
    for value in i16::MIN..=i16::MAX {
        let legal = (-100..=100).contains(&value);
        let error = EncodeError::Percent { value, min: -100, max: 100 };
        match MotorControl::new(value, 0) {
            Ok(command) => assert!(legal && command.speed() == value && command.angular() == 0),
            Err(found) => assert!(!legal && found == error),
        }
        match MotorControl::new(0, value) {
            Ok(command) => assert!(legal && command.speed() == 0 && command.angular() == value),
            Err(found) => assert!(!legal && found == error),
        }
    }
    let error = MotorControl::new(0, -101).unwrap_err();
    assert_eq!(error.to_string(), "-101 is outside -100..=100");
}

#[test]
fn turning_right_is_a_positive_angular_and_left_a_negative_one() {
    for turn in i16::MIN..=i16::MAX {
        let right = MotorControl::turn_right(30, turn).map(|command| command.angular());
        let left = MotorControl::turn_left(30, turn).map(|command| command.angular());
        if (0..=100).contains(&turn) {
            assert_eq!((right, left), (Ok(turn), Ok(-turn)));
        } else {
            let error = Err(EncodeError::Percent { value: turn, min: 0, max: 100 });
            assert_eq!((right, left), (error, error));
        }
    }
    assert!(MotorControl::turn_left(101, 0).is_err());
}

#[test]
fn no_constructor_of_a_motor_command_can_start_an_update() {
    for speed in -100..=100 {
        for angular in [-100, -1, 0, 1, 100] {
            for lamp in [false, true] {
                let command = MotorControl::new(speed, angular).unwrap().with_front_led(lamp);
                assert!(!RawMotorControl::from(command).starts_update());
                let frame = command.frame(0);
                assert_eq!(frame.as_bytes()[12..22], [0; 10]);
                assert_eq!(frame.as_bytes()[10..12], [if lamp { 100 } else { 0 }, 0]);
            }
        }
    }
    assert_eq!(MotorControl::STOP, MotorControl::new(0, 0).unwrap());
}

#[test]
fn a_received_command_that_starts_an_update_says_so() {
    for (version, starts) in
        [(0_u16, false), (38, false), (39, true), (0x7FFF, true), (0x8000, false), (0xFFFF, false)]
    {
        let mut body = [0; 16];
        body[8..10].copy_from_slice(&version.to_le_bytes());
        let bytes = frame(2, &body);
        let Message::MotorControl(command) = Frame::parse(&bytes).unwrap().message() else {
            panic!()
        };
        assert_eq!((command.version(), command.starts_update()), (version, starts));
    }
}

/// A motor command as bytes: speed, angular, front lamp, version.
fn received(speed: i16, angular: i16, front_led: i16, version: u16) -> RawMotorControl {
    let mut body = [0xAB; 16];
    body[0..2].copy_from_slice(&speed.to_le_bytes());
    body[2..4].copy_from_slice(&angular.to_le_bytes());
    body[4..6].copy_from_slice(&front_led.to_le_bytes());
    body[8..10].copy_from_slice(&version.to_le_bytes());
    zerocopy::transmute!(body)
}

#[test]
fn a_received_command_becomes_one_to_be_sent_only_if_it_is_in_range_and_starts_no_update() {
    for version in 0..=u16::MAX {
        let command = MotorControl::try_from(received(10, 20, 100, version));
        if received(10, 20, 100, version).starts_update() {
            assert_eq!(command, Err(EncodeError::StartsUpdate { version }));
        } else {
            // And nothing of its reserved fields is left.
            assert_eq!(command, MotorControl::new(10, 20).map(|it| it.with_front_led(true)));
        }
    }
    for value in i16::MIN..=i16::MAX {
        let by_speed = MotorControl::try_from(received(value, 0, 0, 0));
        let by_angular = MotorControl::try_from(received(0, value, 0, 0));
        assert_eq!(by_speed, MotorControl::new(value, 0));
        assert_eq!(by_angular, MotorControl::new(0, value));
        let lit = !matches!(value.to_le_bytes()[0], 0x00 | 0xFF);
        let lamp = MotorControl::try_from(received(0, 0, value, 0)).unwrap();
        assert_eq!(lamp, MotorControl::STOP.with_front_led(lit));
    }
    let error = EncodeError::StartsUpdate { version: 39 };
    assert_eq!(error.to_string(), "motor command with version 39 would start a firmware update");
}

#[test]
fn foreign_bytes_are_relayed_only_by_the_call_that_says_so() {
    let bytes = frame(2, zerocopy::IntoBytes::as_bytes(&received(130, -500, 7, 99)));
    let mut buffer = [0; 64];
    let view = Frame::parse(&bytes).unwrap();
    assert_eq!(view.relay_unchecked().encoded_len(), 24);
    assert_eq!(view.relay_unchecked().encode(&mut buffer), Ok(&bytes[..]));
    let Message::MotorControl(command) = view.message() else { panic!() };
    assert_eq!((command.speed(), command.version(), command.starts_update()), (130, 99, true));
}

#[test]
fn a_frame_cast_from_bytes_with_the_header_of_another_is_not_encoded() {
    use zerocopy::TryFromBytes;
    let mut buffer = [0xEE; 64];
    for id in 0..=u8::MAX {
        let bytes = frame(id, &[]);
        let ping = FrameOf::<Ping>::try_read_from_bytes(&bytes).unwrap();
        if id == 1 {
            assert_eq!(ping.encode(&mut buffer), Ok(&bytes[..]));
            buffer = [0xEE; 64];
        } else {
            assert_eq!(ping.encode(&mut buffer), Err(EncodeError::Header { id, len: 4 }));
            assert_eq!(buffer, [0xEE; 64]);
        }
    }
    // Nor with a length field that makes shipped robots overflow.
    let mut long = frame(1, &[]);
    long[2] = 253;
    let ping = FrameOf::<Ping>::try_read_from_bytes(&long).unwrap();
    let error = EncodeError::Header { id: 1, len: 253 };
    assert_eq!(ping.encode(&mut buffer), Err(error));
    assert_eq!(error.to_string(), "header with id 0x01 and length 253 is not that of its body");
}

#[test]
fn a_yaw_swings_the_nose_to_its_side_whatever_the_direction_of_travel() {
    for speed in -100..=100 {
        for turn in 0..=100 {
            let right = MotorControl::yaw_right(speed, turn).unwrap();
            let left = MotorControl::yaw_left(speed, turn).unwrap();
            // In reverse the wheel is turned the other way; up to -5 % it turns on the spot.
            let angular = if speed < -5 { -turn } else { turn };
            assert_eq!((right.speed(), right.angular()), (speed, angular));
            assert_eq!((left.speed(), left.angular()), (speed, -angular));
        }
    }
    for speed in [-60, 60] {
        for turn in [-1, 101] {
            let error = Err(EncodeError::Percent { value: turn, min: 0, max: 100 });
            assert_eq!(MotorControl::yaw_right(speed, turn), error);
            assert_eq!(MotorControl::yaw_left(speed, turn), error);
        }
    }
    assert!(MotorControl::yaw_right(101, 0).is_err() && MotorControl::yaw_left(-101, 0).is_err());
}

#[test]
fn the_wheels_turn_as_the_vendors_do_and_not_at_all_in_the_dead_bands() {
    let wheels = |speed, angular| MotorControl::new(speed, angular).unwrap().wheels_pct();
    for (speed, angular, expected) in [
        // Run in the vendor's motor.c (ruling U6).
        (60, 50, (81, 39)),
        (-60, 50, (-81, -39)),
        (100, 100, (100, 30)),
        (100, -100, (30, 100)),
        (0, 100, (70, -70)),
        (5, 11, (7, -7)),
        (5, 10, (0, 0)),
        (6, 0, (6, 6)),
        (50, 5, (50, 50)),
        (50, 6, (52, 47)),
    ] {
        assert_eq!(wheels(speed, angular), expected, "({speed}, {angular})");
    }
    for (speed, angular) in (-100..=100).flat_map(|s| (-100..=100).map(move |a| (s, a))) {
        let (left, right) = wheels(speed, angular);
        assert!(left.abs() <= 100 && right.abs() <= 100, "({speed}, {angular})");
        assert_eq!(wheels(speed, -angular), (right, left), "the other way: the sides change");
        if speed.abs() > 5 {
            assert_eq!(wheels(-speed, angular), (-left, -right), "in reverse: the same, backward");
            assert_eq!(left.signum() * right.signum(), 1, "no side stops or turns back");
        }
    }
}

#[test]
fn a_raw_frame_with_a_known_id_is_refused_and_any_other_is_sent() {
    for id in 0..=u8::MAX {
        let mut buffer = [0xEE; 16];
        let raw = RawFrame { id, index: 5, body: &[1, 2, 3] };
        match raw.encode(&mut buffer) {
            Ok(bytes) => {
                assert!(!(1..=10).contains(&id));
                let parsed = Frame::parse(bytes).unwrap();
                assert_eq!(parsed.message(), Message::Unknown(raw));
            }
            Err(error) => {
                assert!((1..=10).contains(&id));
                assert_eq!(error, EncodeError::KnownId { id });
                assert_eq!(buffer, [0xEE; 16]);
            }
        }
    }
}

#[test]
fn a_body_above_56_bytes_is_refused_and_56_is_sent() {
    let body = [0x5A; 300];
    let mut buffer = [0; 400];
    let raw = |length| RawFrame { id: 0x30, index: 0, body: &body[..length] };
    for length in 0..=56 {
        let bytes = raw(length).encode(&mut buffer).unwrap();
        assert_eq!(bytes.len(), length + 8);
        assert_eq!(Frames::<Ucp>::new(bytes).next().unwrap().body(), &body[..length]);
    }
    for length in [57, 248, 256, 300] {
        let error = EncodeError::BodyTooLong { length, limit: 56 };
        assert_eq!(raw(length).encode(&mut buffer), Err(error));
    }
}

#[test]
fn a_buffer_too_small_is_refused_with_both_lengths_and_left_alone() {
    for available in 0..9 {
        let mut buffer = vec![0xEE; available];
        let too_small = EncodeError::BufferTooSmall { needed: 9, available };
        assert_eq!(Pong::new(ErrorCode::Fine).frame(0).encode(&mut buffer), Err(too_small));
        assert_eq!(RawFrame { id: 99, index: 0, body: &[1] }.encode(&mut buffer), Err(too_small));
        assert_eq!(buffer, vec![0xEE; available]);
    }
}

#[test]
fn parsing_one_frame_says_what_is_wrong_with_it() {
    let good = frame(1, &[0]);
    assert_eq!(Frame::parse(&good).unwrap().as_bytes(), good);
    for length in 0..8 {
        let error = ParseError::Length { expected: 8, found: length };
        assert_eq!(Frame::parse(&good[..length]).unwrap_err(), error);
    }
    let error = ParseError::Length { expected: 9, found: 8 };
    assert_eq!(Frame::parse(&good[..8]).unwrap_err(), error);
    let mut long = good.clone();
    long.push(0);
    assert_eq!(Frame::parse(&long).unwrap_err(), ParseError::Length { expected: 9, found: 10 });
    for bit in 0..8 * good.len() {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        let error = Frame::parse(&bad).unwrap_err();
        match bit / 8 {
            0 | 1 => assert_eq!(error, ParseError::Field),
            2 | 3 => assert!(matches!(error, ParseError::Length { found: 9, .. })),
            _ => assert!(matches!(error, ParseError::Crc { .. })),
        }
    }
}

#[test]
fn every_length_field_is_judged_by_the_cap() {
    for length in 0..=u16::MAX {
        let mut bytes = vec![0xFD, 0xFF];
        bytes.extend(length.to_le_bytes());
        bytes.resize(usize::from(length.min(300)) + 2, 0x11);
        let crc = crc16::compute(&bytes);
        bytes.extend(crc.to_le_bytes());
        let default = Frames::<Ucp>::new(&bytes).next().map(|frame| frame.as_bytes().len());
        let wide = Frames::<Ucp<252>>::new(&bytes).next().map(|frame| frame.as_bytes().len());
        let whole = (length <= 300).then_some(bytes.len());
        assert_eq!(default, whole.filter(|_| (4..=60).contains(&length)), "{length}");
        assert_eq!(wide, whole.filter(|_| (4..=252).contains(&length)), "{length}");
        if !(4..=60).contains(&length) {
            let mut frames = Frames::<Ucp>::new(&bytes[..4]);
            assert!(frames.next().is_none());
            assert_eq!(frames.counters().skipped_for(Reason::Length), 1);
        }
    }
}

#[test]
fn codes_keep_what_they_do_not_know() {
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
    assert_eq!(SetNetworkState::new(NetworkState::Other(256)), None);
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
fn frames_carry_the_index_of_their_sender() {
    for index in 0..=u8::MAX {
        assert_eq!(Ping {}.frame(index).index(), index);
        let bytes = CalibrationStart::new(CalibrationKind::Imu).frame(index);
        assert_eq!(Frame::parse(bytes.as_bytes()).unwrap().index(), index);
    }
    assert_eq!(Header::LEN, 6);
}

#[test]
fn an_update_is_requested_by_a_call_that_says_so() {
    let frame = OtaRequest::start_firmware_update(39).frame(0);
    assert_eq!(frame.as_bytes(), [0xFD, 0xFF, 6, 0, 9, 0, 39, 0, 0x99, 0xD3]);
    assert_eq!(frame.body().version(), 39);
}

#[test]
fn a_received_request_to_update_is_passed_on_by_nothing_but_an_unchecked_relay() {
    let frame = OtaRequest::start_firmware_update(-2).frame(7);
    let frame = Frame::parse(frame.as_bytes()).unwrap();
    let Message::OtaRequest(received) = frame.message() else { panic!() };
    assert_eq!((received.version(), *received), (-2, OtaRequest::start_firmware_update(-2).into()));
    // `RawOtaRequest` has no `frame`: its page shows that this does not compile.
    let mut buffer = [0; 64];
    assert_eq!(frame.relay_unchecked().encode(&mut buffer).unwrap(), frame.as_bytes());
}

#[test]
fn a_frame_behind_a_repeated_sync_byte_is_found() {
    let mut line = vec![0xFD, 0xFD, 0xFD, 0xFF];
    line.extend(frame(1, &[]));
    let mut decoder = axlewire::ucp::Decoder::new();
    let mut input = &line[..];
    let Some(Event::Skipped(gap)) = decoder.decode(&mut input) else { panic!() };
    assert_eq!((gap.len, gap.reason), (4, Reason::Header));
    assert!(matches!(decoder.decode(&mut input), Some(Event::Frame(frame)) if frame.id() == 1));
}
