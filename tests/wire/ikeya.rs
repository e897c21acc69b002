//! Ikeya MD values and packets, exhaustively where possible.

#![cfg(feature = "ikeya")]

use axlewire::ikeya::slave::{DipSwitch, IdReading};

use crate::rig::*;

#[test]
fn a_velocity_response_received_with_nan_or_infinity_is_not_encoded_again() {
    let mut buffer = [0xEE; 20];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let bytes = sealed(&[&[0x55, 3][..], &bad.to_le_bytes()].concat());
        let received = VelocityResponse::parse(bytes[..].try_into().unwrap()).unwrap();
        let error = received.encode(&mut buffer).unwrap_err();
        assert!(matches!(error, EncodeError::NotFinite { .. }), "{error}");
        for motor in 0..3 {
            let mut speeds = [1.0; 3];
            speeds[motor] = bad;
            let speeds = speeds.map(f32::to_le_bytes).concat();
            let bytes = sealed(&[&[0x55, 3][..], &speeds].concat());
            let received = three::VelocityResponse::parse(bytes[..].try_into().unwrap()).unwrap();
            let error = received.encode(&mut buffer).unwrap_err();
            assert!(matches!(error, EncodeError::NotFinite { .. }), "{error}");
        }
    }
    assert_eq!(buffer, [0xEE; 20], "an error writes nothing");
}

#[test]
fn ids_are_1_to_8_and_every_other_byte_is_refused() {
    for id in 0..=u8::MAX {
        match NodeId::new(id) {
            Ok(node) => assert!((1..=8).contains(&id) && node.get() == id && u8::from(node) == id),
            Err(error) => {
                assert!(!(1..=8).contains(&id));
                assert_eq!(error, EncodeError::NodeId { value: id });
                assert_eq!(error.to_string(), format!("node id {id} is outside 1..=8"));
            }
        }
    }
    assert_eq!(NodeId::ALL.map(NodeId::get), [1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(NodeId::try_from(4), Ok(NodeId::N4));
    assert_eq!(format!("{:>3}", NodeId::N8), "  8");
}

#[test]
fn every_header_and_id_is_parsed_or_refused_by_each_packet() {
    for header in 0..=u8::MAX {
        for id in 0..=u8::MAX {
            let good = |expected: u8| header == expected && (1..=8).contains(&id);
            let short: [u8; 4] = sealed(&[header, id]).try_into().unwrap();
            let long: [u8; 8] = sealed(&[header, id, 1, 2, 3, 4]).try_into().unwrap();
            let refused = ParseError::Field;
            let read = ReadRequest::parse(&short).map(|it| (it.id().get(), it.as_bytes()));
            assert_eq!(read, if good(0xAA) { Ok((id, &short)) } else { Err(refused) });
            let write = WriteRequest::parse(&long).map(|it| (it.id().get(), it.as_bytes()));
            assert_eq!(write, if good(0xBB) { Ok((id, &long)) } else { Err(refused) });
            let velocity = VelocityResponse::parse(&long).map(|it| (it.id().get(), it.as_bytes()));
            assert_eq!(velocity, if good(0x55) { Ok((id, &long)) } else { Err(refused) });
            let position = PositionResponse::parse(&long).map(|it| (it.id().get(), it.as_bytes()));
            assert_eq!(position, if good(0x56) { Ok((id, &long)) } else { Err(refused) });
        }
    }
}

#[test]
fn every_single_bit_error_in_a_packet_is_refused() {
    let good = *VelocityResponse::new(NodeId::N2, Rps::new(1.0).unwrap()).as_bytes();
    assert_eq!(good, [0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E]);
    for bit in 0..64 {
        let mut bad = good;
        bad[bit / 8] ^= 1 << (bit % 8);
        assert!(VelocityResponse::parse(&bad).is_err(), "bit {bit}");
    }
    let mut bad = good;
    bad[6] ^= 1;
    let error = VelocityResponse::parse(&bad).unwrap_err();
    assert_eq!(error, ParseError::Crc { expected: 0x0E54, found: 0x0E55 });
    assert_eq!(error.to_string(), "CRC is 0x0e54, but packet has 0x0e55");
}

#[test]
fn every_count_and_every_rotation_survives_the_wire() {
    for half in i16::MIN..=i16::MAX {
        for position in [Position::new(half, 7), Position::new(7, half)] {
            let write = WriteRequest::position(NodeId::N1, position);
            let response = PositionResponse::new(NodeId::N1, position);
            assert_eq!(WriteRequest::parse(write.as_bytes()).unwrap().as_position(), position);
            assert_eq!(PositionResponse::parse(response.as_bytes()).unwrap().position(), position);
            let counts = i64::from(position.rotation()) * 8192 + i64::from(position.count());
            assert_eq!(i64::from(position.counts()), counts);
        }
    }
}

#[test]
fn unusual_floats_decode_and_only_finite_ones_encode() {
    let floats = [
        0x7FC0_0000_u32, // NaN
        0xFFFF_FFFF,     // NaN with all bits set
        0x7F80_0001,     // signalling NaN
        0x7F80_0000,     // +infinity
        0xFF80_0000,     // -infinity
        0x8000_0000,     // -0.0
        0x0000_0001,     // smallest subnormal
        0x807F_FFFF,     // largest negative subnormal
        0x7F7F_FFFF,     // largest finite number
        0xFF7F_FFFF,
    ];
    for bits in floats {
        let [a, b, c, d] = bits.to_le_bytes();
        for header in [0x55, 0xBB] {
            let bytes = sealed(&[header, 3, a, b, c, d]);
            let packet = Frames::<BothDirections>::new(&bytes).next().expect("any f32 decodes");
            let rps = match packet {
                Packet::Response(Response::Velocity(response)) => response.rps(),
                Packet::Request(Request::Write(write)) => write.as_velocity(),
                other => panic!("{other:?}"),
            };
            assert_eq!(rps.to_bits(), bits);
            match Rps::new(rps) {
                Ok(rps) => {
                    let write = WriteRequest::velocity(NodeId::N3, rps);
                    assert_eq!(write.payload(), bits.to_le_bytes());
                }
                Err(EncodeError::NotFinite { value }) => {
                    assert!(!rps.is_finite());
                    assert!(
                        value.is_nan() == rps.is_nan() && value.is_infinite() == rps.is_infinite()
                    );
                }
                Err(other) => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn a_speed_converts_between_its_units() {
    assert_eq!(Rps::from_rpm(60.0).unwrap().get(), 1.0);
    assert_eq!(Rps::new(-2.5).unwrap().rpm(), -150.0);
    let turn = Rps::from_rad_per_s(core::f32::consts::TAU).unwrap();
    assert_eq!((turn.get(), turn.rad_per_s()), (1.0, core::f32::consts::TAU));
    assert_eq!((f32::from(Rps::ZERO), f32::from(Rps::new(-2.5).unwrap())), (0.0, -2.5));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(Rps::new(bad).is_err() && Rps::from_rpm(bad).is_err());
        assert!(Rps::from_rad_per_s(bad).is_err() && Rps::try_from(bad).is_err());
    }
}

#[test]
fn a_position_splits_so_that_both_parts_have_the_sign_of_the_total() {
    // From the public master itself: -pi, -3 pi, and one count less than a turn.
    for (counts, count, rotation) in [
        (-4096, -4096, 0),
        (-12_288, -4096, -1),
        (8191, 8191, 0),
        (8192, 0, 1),
        (-8192, 0, -1),
        (0, 0, 0),
    ] {
        assert_eq!(Position::from_counts(counts), Ok(Position::new(count, rotation)));
    }
}

#[test]
fn a_position_splits_with_a_count_of_0_to_8191_on_request() {
    for (counts, count, rotation) in
        [(-4096, 4096, -1), (-1, 8191, -1), (-8192, 0, -1), (8193, 1, 1)]
    {
        assert_eq!(Position::from_counts_euclidean(counts), Ok(Position::new(count, rotation)));
    }
}

#[test]
fn both_splits_name_the_same_position_over_their_whole_range() {
    let edges = [-268_443_647, -268_435_456, -1, 0, 1, 268_435_455];
    let steps = (-268_435_456..=268_435_455).step_by(4093);
    for counts in edges.into_iter().chain(steps) {
        assert_eq!(Position::from_counts(counts).unwrap().counts(), counts);
        if counts >= -268_435_456 {
            assert_eq!(Position::from_counts_euclidean(counts).unwrap().counts(), counts);
        }
    }
}

#[test]
fn a_position_out_of_range_is_an_error_and_never_a_wrap_or_a_clamp() {
    let truncating = |counts| EncodeError::Position { counts, min: -268_443_647, max: 268_435_455 };
    for counts in [i32::MIN, -268_443_648, 268_435_456, i32::MAX] {
        assert_eq!(Position::from_counts(counts), Err(truncating(counts.into())));
    }
    for counts in [i32::MIN, -268_435_457, 268_435_456, i32::MAX] {
        let error =
            EncodeError::Position { counts: counts.into(), min: -268_435_456, max: 268_435_455 };
        assert_eq!(Position::from_counts_euclidean(counts), Err(error));
    }
    assert_eq!(Position::from_revolutions(32768.0), Err(truncating(268_435_456)));
    assert_eq!(Position::from_revolutions(-32769.0), Err(truncating(-268_443_648)));
    assert_eq!(Position::from_revolutions(1e9), Err(truncating(8_192_000_000_000)));
    assert_eq!(Position::from_revolutions(-1e300), Err(truncating(i64::MIN)));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(Position::from_revolutions(bad), Err(EncodeError::NotFinite { .. })));
        assert!(matches!(Position::from_radians(bad), Err(EncodeError::NotFinite { .. })));
    }
}

#[test]
fn revolutions_and_radians_go_to_the_nearest_count_and_back() {
    for counts in [-268_435_455, -12_345, -1, 0, 1, 4096, 268_435_455] {
        let position = Position::from_counts(counts).unwrap();
        assert_eq!(Position::from_revolutions(position.revolutions()), Ok(position));
        assert_eq!(Position::from_radians(position.radians()), Ok(position));
    }
    let quarter_count = 0.25 / 8192.0;
    assert_eq!(Position::from_revolutions(1.0 + quarter_count).unwrap().counts(), 8192);
    assert_eq!(Position::from_revolutions(1.0 - quarter_count).unwrap().counts(), 8192);
    assert_eq!(Position::from_revolutions(-1.0 - 3.0 * quarter_count).unwrap().counts(), -8193);
}

#[test]
fn dip_switches_are_read_as_configured_and_never_guessed() {
    let value = |digits: &str| digits.parse::<DipSwitch>().unwrap().node_id(IdReading::Value);
    let plus_one =
        |digits: &str| digits.parse::<DipSwitch>().unwrap().node_id(IdReading::ValuePlusOne);
    // The document's two examples, each of which needs a different interpretation.
    assert_eq!(value("0010"), Ok(NodeId::N1));
    assert_eq!(plus_one("0101"), Ok(NodeId::N3));
    assert_eq!("0010".parse::<DipSwitch>().unwrap().mode(), Mode::Velocity);
    assert_eq!("0101".parse::<DipSwitch>().unwrap().mode(), Mode::Position);
    for bits in 0..=u8::MAX {
        let Ok(dip) = DipSwitch::from_bits(bits) else {
            assert_eq!(DipSwitch::from_bits(bits), Err(EncodeError::DipSwitch { bits }));
            assert!(bits > 15);
            continue;
        };
        assert!(bits <= 15 && dip.bits() == bits);
        assert_eq!(dip.node_id(IdReading::ValuePlusOne).unwrap().get(), (bits >> 1) + 1);
        match dip.node_id(IdReading::Value) {
            Ok(id) => assert_eq!(id.get(), bits >> 1),
            Err(error) => assert_eq!((bits >> 1, error), (0, EncodeError::DipSwitch { bits })),
        }
        assert_eq!(format!("{bits:04b}").parse(), Ok(dip));
    }
    for bad in ["", "010", "01010", "0120", "+101", "abcd", "111111111"] {
        assert!(bad.parse::<DipSwitch>().is_err(), "{bad}");
    }
}

#[test]
fn a_buffer_too_small_is_refused_with_both_lengths_and_left_alone() {
    let packet = WriteRequest::velocity(NodeId::N1, Rps::ZERO);
    for available in 0..8 {
        let mut buffer = vec![0xEE; available];
        let error = packet.encode(&mut buffer).unwrap_err();
        assert_eq!(error, EncodeError::BufferTooSmall { needed: 8, available });
        assert_eq!(buffer, vec![0xEE; available]);
    }
    let mut buffer = [0xEE; 10];
    assert_eq!(packet.encode(&mut buffer).unwrap(), packet.as_bytes());
    assert_eq!((packet.encoded_len(), &buffer[8..]), (8, &[0xEE, 0xEE][..]));
}

#[test]
fn one_rps_read_as_a_position_is_16256_turns() {
    let write = WriteRequest::velocity(NodeId::N1, Rps::new(1.0).unwrap());
    assert_eq!(write.as_position(), Position::new(0, 16_256));
    let write = WriteRequest::position(NodeId::N1, Position::new(0, -1));
    assert!(write.as_velocity().is_nan());
}

#[cfg(feature = "arbitrary")]
#[test]
fn an_arbitrary_speed_is_any_finite_one() {
    let speed = |rps: f32| arbitrary::Unstructured::new(&rps.to_le_bytes()).arbitrary::<Rps>();
    assert_eq!(speed(-2.5).unwrap().get(), -2.5);
    assert!(speed(f32::NAN).is_err());
}
