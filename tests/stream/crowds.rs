//! Dense headers, where candidates are rejected in batches, against the slow oracle.

use axlewire::ikeya::{BothDirections, ToMaster, ToSlave};
use proptest::{collection::vec, prelude::*, sample::select};

use crate::{
    checked_line::{self, Op},
    oracle::{self, Rules},
    rig::*,
};

/// `x^15 + x + 1`: added to a good CRC, it leaves a multiple of itself, of odd parity.
const TRINOMIAL: u16 = 0xC001;

macro_rules! properties {
    ($($name:ident: $framing:ty, $max_len:literal;)+) => {$(
        mod $name {
            use super::*;

            type F = $framing;

            #[test]
            fn a_packet_is_found_at_every_position_among_dense_headers() {
                check_every_place::<F>();
            }

            #[test]
            fn dense_headers_may_be_cut_anywhere() {
                check_every_cut::<F, $max_len>();
            }

            proptest! {
                #[test]
                fn dense_headers_match_the_oracle(stream in stream(F::RULES)) {
                    check_slice::<F>(&stream);
                }

                #[test]
                fn chunks_of_dense_headers_do_not_matter(
                    stream in stream(F::RULES),
                    chunks in vec(0..150_usize, 1..6),
                ) {
                    let ops = |op: fn(usize) -> Op| chunks.iter().copied().map(op).collect::<Vec<_>>();
                    CheckedLine::<F, $max_len>::new().play(&stream, &ops(Op::Slice));
                    CheckedLine::<F, 300>::new().play(&stream, &ops(Op::Slice));
                    let filled: Vec<_> = ops(Op::Commit).into_iter().chain([Op::Idle]).collect();
                    CheckedLine::<F, 300>::new().play(&stream, &filled);
                }
            }
        }
    )+};
}

properties! {
    to_slave: ToSlave, 8;
    to_master: ToMaster, 8;
    either: BothDirections, 8;
    three_to_slave: three::ToSlave, 16;
    three_to_master: three::ToMaster, 16;
    three_either: three::BothDirections, 16;
    ucp_by_default: Ucp, 64;
    ucp_with_the_smallest_cap: Ucp<4>, 8;
    ucp_with_the_largest_cap: Ucp<252>, 256;
}

/// Whole frames and near misses: a node that cannot exist, an impossible length, odd parity, plain
/// damage.
fn packets(rules: Rules) -> Vec<Vec<u8>> {
    let mut starts: Vec<(Vec<u8>, usize)> = Vec::new();
    match rules {
        Rules::Ikeya { long, .. } => {
            for (header, len) in [(0xAA, 4), (0xBB, long), (0x55, long), (0x56, long)] {
                starts.extend([0, 1, 8, 9].map(|id| (vec![header, id], len)));
            }
        }
        Rules::Ucp { .. } => {
            let lens = [0, 3, 4, 5, 40, 60, 61, 252, 253].map(|len| (len, 0));
            for (low, high) in lens.into_iter().chain([(4, 1), (40, 0xFF)]) {
                starts.push((vec![0xFD, 0xFF, low, high], usize::from(low.max(4)) + 4));
            }
        }
    }
    let mut packets = Vec::new();
    for (mut packet, len) in starts {
        packet.resize(len, 0xAA);
        oracle::seal(&mut packet);
        for change in [0, TRINOMIAL, 0x0100] {
            let [low, high] = u16::to_le_bytes(change);
            packets.push(packet.clone());
            let [.., first, second] = packets.last_mut().unwrap().as_mut_slice() else { continue };
            (*first, *second) = (*first ^ low, *second ^ high);
        }
    }
    packets
}

/// Bytes that can begin a frame.
fn headers(rules: Rules) -> Vec<u8> {
    match rules {
        Rules::Ikeya { .. } => vec![0xAA, 0xBB, 0x55, 0x56],
        Rules::Ucp { .. } => vec![0xFD, 0xFF],
    }
}

/// This many of them, shuffled.
fn crowd(rules: Rules, len: usize) -> Vec<u8> {
    let headers = headers(rules);
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        headers[(state >> 16) as usize % headers.len()]
    };
    (0..len).map(|_| next()).collect()
}

/// Dense headers with packets and sparser stretches, 0 to about 400 bytes.
fn stream(rules: Rules) -> impl Strategy<Value = Vec<u8>> {
    let header = select(headers(rules));
    let byte = prop_oneof![3 => header.clone(), 1 => select(vec![0, 1, 2, 4, 9, 0x28, 0xFC])];
    let piece = prop_oneof![
        3 => vec(header, 0..60),
        3 => vec(byte, 0..60),
        1 => vec(any::<u8>(), 0..60),
        4 => select(packets(rules)),
    ];
    vec(piece, 0..12).prop_map(|pieces| pieces.concat())
}

/// Frames, gaps and counters of a slice.
fn check_slice<F: Known>(stream: &[u8]) {
    checked_line::check_slice::<F>(stream);
    checked_line::check_finished_slice::<F>(stream);
}

fn check_every_place<F: Known>() {
    let crowd = crowd(F::RULES, 110);
    for packet in packets(F::RULES) {
        for at in 0..40 {
            let stream = [&crowd[..at], &packet, &crowd[at..]].concat();
            check_slice::<F>(&stream);
        }
    }
}

fn check_every_cut<F: Known, const N: usize>() {
    let crowd = crowd(F::RULES, 60);
    for packet in packets(F::RULES) {
        let stream = [&crowd[..], &packet, &crowd].concat();
        for len in 40..stream.len() {
            check_slice::<F>(&stream[..len]);
        }
        CheckedLine::<F, N>::new().play(&stream, &[Op::Slice(70), Op::Slice(stream.len())]);
    }
}
