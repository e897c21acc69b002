//! Frames judged together, and bytes rejected together, against the slow oracle:
//! streams long enough for lanes, damaged everywhere.

use axlewire::{
    ikeya::{self, PositionResponse, ReadRequest, VelocityResponse, WriteRequest},
    ucp,
};
use proptest::{collection::vec, prelude::*};

use crate::{checked_line, oracle, rig::*};

/// Singly and in batches: the frames of the oracle, and its counters.
fn check<F: Known>(stream: &[u8]) {
    checked_line::check_slice::<F>(stream);
    checked_line::check_finished_slice::<F>(stream);
}

/// Every framing that uses lanes, and one that does not.
fn check_all(stream: &[u8]) {
    check::<ikeya::ToSlave>(stream);
    check::<ikeya::ToMaster>(stream);
    check::<ikeya::BothDirections>(stream);
    check::<three::BothDirections>(stream);
    check::<Ucp>(stream);
    check::<Ucp<252>>(stream);
}

fn response(number: u8) -> [u8; 8] {
    let id = NodeId::ALL[usize::from(number % 8)];
    if number.is_multiple_of(2) {
        let position = Position::new(i16::from(number) * 257, -i16::from(number));
        *PositionResponse::new(id, position).as_bytes()
    } else {
        *VelocityResponse::new(id, Rps::new(f32::from(number) / 3.0).unwrap()).as_bytes()
    }
}

fn responses(count: u8) -> Vec<u8> {
    (0..count).flat_map(response).collect()
}

/// READ, answer, WRITE, and so on.
fn exchanges(count: u8) -> Vec<u8> {
    let exchange = |number: u8| {
        let id = NodeId::ALL[usize::from(number % 8)];
        let write = WriteRequest::velocity(id, Rps::new(f32::from(number)).unwrap());
        [ReadRequest::new(id).as_bytes(), &response(number)[..], write.as_bytes()].concat()
    };
    (0..count).flat_map(exchange).collect()
}

fn pings(count: u8) -> Vec<u8> {
    (0..count).flat_map(|index| ucp::message::Ping {}.frame(index).as_bytes().to_vec()).collect()
}

#[test]
fn damage_at_any_byte_of_a_run_costs_what_the_oracle_says() {
    /// Puts each of these in the place of each byte: or damage of one bit, for 0.
    fn damaged<F: Known>(clean: &[u8], by: &[u8]) {
        let mut stream = clean.to_vec();
        for at in 0..clean.len() {
            for &byte in by {
                stream[at] = if byte == 0 { clean[at] ^ 0x10 } else { byte };
                check::<F>(&stream);
            }
            stream[at] = clean[at];
        }
    }
    // A header in the wrong place, and one of another kind.
    damaged::<ikeya::BothDirections>(&responses(50), &[0, 0xAA, 0xBB, 0x55]);
    damaged::<ikeya::BothDirections>(&exchanges(20), &[0, 0xAA, 0xBB, 0x55]);
    damaged::<Ucp>(&pings(50), &[0, 0xFD]);
}

#[test]
fn a_lost_or_doubled_byte_anywhere_in_a_run_costs_what_the_oracle_says() {
    for clean in [responses(40), exchanges(16)] {
        for at in 0..clean.len() {
            let (head, tail) = clean.split_at(at);
            check::<ikeya::BothDirections>(&[head, &tail[1..]].concat());
            check::<ikeya::ToMaster>(&[head, &tail[..1], tail].concat());
        }
    }
}

#[test]
fn a_foreign_packet_with_a_good_crc_is_skipped_anywhere_in_a_run() {
    let clean = responses(40);
    for at in (0..clean.len()).step_by(8) {
        for id in [0, 1, 9, 128, 255] {
            for header in [0x55, 0x56, 0xBB, 0xAA, 0x57, 0x00] {
                let payload = [1, 2, 3, 4];
                let payload = if header == 0xAA { &[][..] } else { &payload };
                let packet = hostile_streams::ikeya_packet_around(header, id, payload);
                let stream = [&clean[..at], &packet, &clean[at..]].concat();
                check::<ikeya::BothDirections>(&stream);
                check::<ikeya::ToSlave>(&stream);
            }
        }
    }
}

#[test]
fn a_stream_may_end_anywhere() {
    for clean in [responses(50), exchanges(20)] {
        for end in 0..=clean.len() {
            check::<ikeya::BothDirections>(&clean[..end]);
            check::<ikeya::ToMaster>(&clean[..end]);
        }
    }
}

#[test]
fn a_frame_behind_noise_of_any_length_is_found() {
    // Bytes that are headers, that are not, and that are half a sync.
    for noise in [&[0xAA][..], &[0xBB, 1], &[0x55, 0x56, 0xAA, 0xBB], &[0], &[0xFD], &[0xFD, 0xFF]]
    {
        for len in 0..300 {
            let mut stream: Vec<u8> = noise.iter().copied().cycle().take(len).collect();
            stream.extend(responses(2));
            stream.extend(pings(2));
            stream.extend(responses(12));
            check::<ikeya::BothDirections>(&stream);
            check::<Ucp>(&stream);
        }
    }
}

#[test]
fn half_a_sync_is_found_beside_bytes_of_any_value() {
    for value in 0..=u8::MAX {
        for len in 0..20 {
            // The bytes after the first FD look like one when eight bytes are judged together.
            let half =
                [&vec![value; len][..], &[0xFD], &[value ^ 1; 3], &[0xFD, 0xFC, 0xFD]].concat();
            check::<Ucp>(&[&half[..], &pings(2)].concat());
        }
    }
}

#[test]
fn false_lengths_are_counted_as_such() {
    for cap_and_more in [[3, 0], [4, 0], [60, 0], [61, 0], [252, 0], [253, 0], [4, 1], [0, 4]] {
        let start = [&[0xFD, 0xFF][..], &cap_and_more].concat();
        check_all(&[start.repeat(200), pings(3)].concat());
    }
}

#[test]
fn a_packet_that_begins_inside_another_one_is_not_delivered() {
    // The second begins in the middle of the first, whose CRC is part of its payload.
    let mut both = [0x55, 3, 0x12, 0x34, 0x55, 5, 0, 0, 0x56, 0x78, 0, 0];
    oracle::seal(&mut both[..8]);
    oracle::seal(&mut both[4..]);
    for reads in 0..3 {
        for count in 0..70 {
            let reads = ReadRequest::new(NodeId::N1).as_bytes().repeat(reads);
            check_all(&[reads, responses(count), both.to_vec(), responses(70)].concat());
        }
    }
}

/// Long streams of everything, with long runs of good frames.
fn long_stream(rules: oracle::Rules) -> impl Strategy<Value = Vec<u8>> {
    let run = vec(hostile_streams::frame(rules), 0..60).prop_map(|frames| frames.concat());
    let noise = vec(any::<u8>(), 0..200);
    vec(prop_oneof![4 => hostile_streams::stream(rules), 3 => run, 1 => noise], 1..8)
        .prop_map(|pieces| pieces.concat())
}

macro_rules! properties {
    ($($name:ident: $framing:ty;)+) => {$(
        proptest! {
            #[test]
            fn $name(stream in long_stream(<$framing as Known>::RULES)) {
                check::<$framing>(&stream);
            }
        }
    )+};
}

properties! {
    a_long_stream_to_slaves_gives_what_the_oracle_says: ikeya::ToSlave;
    a_long_stream_to_the_master_gives_what_the_oracle_says: ikeya::ToMaster;
    a_long_stream_of_both_gives_what_the_oracle_says: ikeya::BothDirections;
    a_long_stream_of_three_motors_gives_what_the_oracle_says: three::BothDirections;
    a_long_stream_of_ucp_gives_what_the_oracle_says: Ucp;
    a_long_stream_of_long_ucp_frames_gives_what_the_oracle_says: Ucp<252>;
}
