use std::ops::Range;

use axlewire::ikeya::{BothDirections, Packet, Request, Response};

use super::*;

/// The oracle's CRC, by a table that the oracle fills: bit by bit, 2^32 payloads would take hours.
struct Crcs([u16; 256]);

impl Crcs {
    fn new() -> Self {
        // The CRC of one byte is one step from the initial value.
        Self(core::array::from_fn(|index| oracle::crc(&[index as u8 ^ 0xFF]) ^ 0x00FF))
    }

    fn of(&self, bytes: &[u8]) -> u16 {
        bytes.iter().fold(0xFFFF, |crc, &byte| {
            let [low, high] = u16::to_le_bytes(crc);
            u16::from(high) ^ self.0[usize::from(low ^ byte)]
        })
    }

    /// The packet as the protocol document draws it.
    fn packet(&self, header: u8, id: u8, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
        let [low, high] = self.of(&[header, id, a, b, c, d]).to_le_bytes();
        [header, id, a, b, c, d, low, high]
    }
}

#[test]
fn the_table_gives_the_crc_of_the_oracle() {
    let (crcs, mut dice) = (Crcs::new(), Dice(1));
    // From all states that a byte leads to, and every byte: each entry, after each other.
    for pair in 0..=u16::MAX {
        assert_eq!(crcs.of(&pair.to_le_bytes()), oracle::crc(&pair.to_le_bytes()));
    }
    for len in 0..100 {
        let bytes = dice.bytes(len);
        assert_eq!(crcs.of(&bytes), oracle::crc(&bytes));
    }
}

/// Encodes and decodes these payloads as all three packets. Returns the number of those that are no
/// finite speed, so that no constructor takes them (ruling I4).
fn round_trip(crcs: &Crcs, payloads: Range<u64>, node: impl Fn(u32) -> NodeId) -> u64 {
    let mut refused = 0;
    for payload in payloads {
        let payload = payload as u32;
        let (bytes, id) = (payload.to_le_bytes(), node(payload));
        let expected = |header| crcs.packet(header, id.get(), bytes);
        let (write, velocity, position) = (expected(0xBB), expected(0x55), expected(0x56));

        let [count, rotation] = [payload as u16 as i16, (payload >> 16) as u16 as i16];
        let place = Position::new(count, rotation);
        assert_encodes(&WriteRequest::position(id, place), &write);
        assert_encodes(&PositionResponse::new(id, place), &position);
        match Rps::new(f32::from_bits(payload)) {
            Ok(rps) => {
                assert_encodes(&WriteRequest::velocity(id, rps), &write);
                assert_encodes(&VelocityResponse::new(id, rps), &velocity);
            }
            Err(error) => {
                // All ones in the exponent: an infinity or no number.
                assert_eq!(payload & 0x7F80_0000, 0x7F80_0000, "{error}");
                refused += 1;
            }
        }

        let check_write = |packet: &WriteRequest| {
            assert_eq!((packet.id(), packet.payload()), (id, bytes));
            assert_eq!((packet.as_velocity().to_bits(), packet.as_position()), (payload, place));
        };
        let check_velocity = |packet: &VelocityResponse| {
            assert_eq!((packet.id(), packet.rps().to_bits()), (id, payload));
        };
        let check_position = |packet: &PositionResponse| {
            let found = packet.position();
            assert_eq!((packet.id(), found.count(), found.rotation()), (id, count, rotation));
        };
        check_write(WriteRequest::parse(&write).unwrap());
        check_velocity(VelocityResponse::parse(&velocity).unwrap());
        check_position(PositionResponse::parse(&position).unwrap());
        for bytes in [&write, &velocity, &position] {
            match Frames::<BothDirections>::new(bytes).next() {
                Some(Packet::Request(Request::Write(packet))) => check_write(packet),
                Some(Packet::Response(Response::Velocity(packet))) => check_velocity(packet),
                Some(Packet::Response(Response::Position(packet))) => check_position(packet),
                other => panic!("{bytes:02x?} is {other:?}"),
            }
        }
    }
    refused
}

#[inline(always)]
fn assert_encodes(packet: &impl Encode, expected: &[u8; 8]) {
    let mut buffer = [0; 8];
    assert_eq!(packet.encode(&mut buffer), Ok(&expected[..]));
}

#[test]
fn payloads_with_every_second_half_and_every_node_survive_the_wire() {
    let crcs = Crcs::new();
    for id in NodeId::ALL {
        let start = 0x0001_2345 * u64::from(id.get());
        assert_eq!(round_trip(&crcs, start..start + 2000, |_| id), 0);
    }
    for high in 0..=u64::from(u16::MAX) {
        let payload = high << 16 | (high ^ 0x5A5A);
        let refused = round_trip(&crcs, payload..payload + 1, |_| NodeId::N3);
        assert_eq!(refused == 1, high & 0x7F80 == 0x7F80, "{payload:#x}");
    }
}

#[test]
#[ignore = "takes minutes: see the top of main.rs"]
fn all_payloads_of_a_write_and_of_both_responses_survive_the_wire() {
    let crcs = Crcs::new();
    // Each payload goes to one node, each node gets one payload in eight, in no simple order.
    let node = |payload: u32| NodeId::ALL[(payload.wrapping_mul(0x9E37_79B1) >> 29) as usize];
    let refused: u64 =
        on_all_cores(1 << 32, |payloads| round_trip(&crcs, payloads, node)).iter().sum();
    assert_eq!(refused, 1 << 24, "the infinities and what is no number");
    println!("2^32 payloads, three packets each; {refused} are no speed");
}
