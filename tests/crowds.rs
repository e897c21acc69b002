//! Crowds of headers, where candidates are refused many at a time, against the slow oracle.
#![cfg(feature = "ikeya")]

#[path = "support/line.rs"]
#[allow(dead_code, reason = "tests/stream.rs uses more of it")]
mod line;
#[path = "support/oracle.rs"]
#[allow(dead_code, reason = "tests/stream.rs uses more of it")]
mod oracle;

use axlewire::{
    ikeya::{Either, ToMaster, ToSlave, three},
    stream::{Frames, Framing, Reason, Swept, Verdict, decode_capture},
};
use line::{Known, Line, Op};
use oracle::Rules;
use proptest::{collection::vec, prelude::*, sample::select};

/// `x^15 + x + 1`: added to a good CRC it leaves a multiple of it, of odd parity.
const TRINOMIAL: u16 = 0xC001;

macro_rules! properties {
    ($($name:ident: $framing:ty, $max_len:literal;)+) => {$(
        mod $name {
            use super::*;

            type F = $framing;

            #[test]
            fn a_packet_is_found_at_every_place_of_a_crowd() {
                check_every_place::<F>();
            }

            #[test]
            fn a_crowd_may_be_cut_anywhere() {
                check_every_cut::<F, $max_len>();
            }

            #[cfg(target_pointer_width = "64")]
            #[test]
            fn a_crowd_is_swept_up_to_its_last_places() {
                let crowd = crowd(200);
                let swept = <F as Framing>::sweep(&crowd).len;
                assert!((100..=200 - F::MAX_LEN).contains(&swept), "{swept}");
                check_sweep::<F>(&crowd);
            }

            proptest! {
                #[test]
                fn a_sweep_refuses_what_single_looks_refuse(stream in stream(F::RULES)) {
                    (0..stream.len()).for_each(|at| check_sweep::<F>(&stream[at..]));
                }

                #[test]
                fn a_crowd_gives_what_the_oracle_says(stream in stream(F::RULES)) {
                    check_slice::<F>(&stream);
                }

                #[test]
                fn chunks_of_a_crowd_do_not_matter(
                    stream in stream(F::RULES),
                    chunks in vec(0..150_usize, 1..6),
                ) {
                    let ops = |op: fn(usize) -> Op| chunks.iter().copied().map(op).collect::<Vec<_>>();
                    Line::<F, $max_len>::new().play(&stream, &ops(Op::Slice));
                    Line::<F, 150>::new().play(&stream, &ops(Op::Slice));
                    let filled: Vec<_> = ops(Op::Commit).into_iter().chain([Op::Idle]).collect();
                    Line::<F, 150>::new().play(&stream, &filled);
                }
            }
        }
    )+};
}

properties! {
    to_slave: ToSlave, 8;
    to_master: ToMaster, 8;
    either: Either, 8;
    three_to_slave: three::ToSlave, 16;
    three_to_master: three::ToMaster, 16;
    three_either: three::Either, 16;
}

/// Every packet of interest, each of the four headers with an id: good, of a node that cannot exist,
/// of odd parity, and plainly damaged.
fn packets(rules: Rules) -> Vec<Vec<u8>> {
    let Rules::Ikeya { long, .. } = rules else { unreachable!("the bus alone has such packets") };
    let mut packets = Vec::new();
    for (header, len) in [(0xAA, 4), (0xBB, long), (0x55, long), (0x56, long)] {
        for id in [0, 1, 8, 9] {
            for change in [0, TRINOMIAL, 0x0100] {
                let mut packet = vec![0xAA; len];
                (packet[0], packet[1]) = (header, id);
                oracle::seal(&mut packet);
                let crc = u16::from_le_bytes([packet[len - 2], packet[len - 1]]) ^ change;
                packet[len - 2..].copy_from_slice(&crc.to_le_bytes());
                packets.push(packet);
            }
        }
    }
    packets
}

/// So many headers in no order.
fn crowd(len: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        [0xAA, 0xBB, 0x55, 0x56][state as usize >> 30]
    };
    (0..len).map(|_| next()).collect()
}

/// Crowds with packets in them and with thinner places, 0 to some 400 bytes.
fn stream(rules: Rules) -> impl Strategy<Value = Vec<u8>> {
    let header = select(vec![0xAA_u8, 0xBB, 0x55, 0x56]);
    let byte = prop_oneof![3 => header.clone(), 1 => select(vec![0, 1, 2, 9, 0xAA, 0x55])];
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
    let told = oracle::answer(F::RULES, stream, &[]);
    let mut frames = Frames::<F>::new(stream);
    for (offset, len) in told.frames() {
        let frame = frames.next().expect("one frame less than the oracle has");
        assert_eq!(F::bytes(&frame).as_ptr_range(), stream[offset..offset + len].as_ptr_range());
    }
    assert!(frames.next().is_none(), "one frame more than the oracle has");
    assert_eq!(frames.rest(), &stream[stream.len() - told.pending..]);
    line::check_counters(&frames.counters(), &told, stream.len());

    // A capture ends with a silence, as often as there is something left.
    let idles = vec![stream.len(); stream.len() + 1];
    let mut told = oracle::answer(F::RULES, stream, &idles);
    told.join_gaps();
    let (events, counters) = decode_capture::<F>(stream);
    let events: Vec<_> = events.into_iter().map(|located| line::located::<F>(located)).collect();
    assert_eq!(events, told.events);
    line::check_counters(&counters, &told, stream.len());
}

/// What a sweep refuses is what `judge` refuses at each place, and for the same reasons.
fn check_sweep<F: Framing>(bytes: &[u8]) {
    let Swept { len, length, crc } = F::sweep(bytes);
    let mut failed = 0;
    for at in 0..len {
        match F::judge(&bytes[at..]) {
            Verdict::Reject { reason: Reason::Crc, more: 0 } => failed += 1,
            Verdict::Reject { reason: Reason::Header, .. } => {}
            verdict => panic!("{verdict:?} at {at} of {len}"),
        }
    }
    assert_eq!(crc, failed);
}

fn check_every_place<F: Known>() {
    let crowd = crowd(130);
    for packet in packets(F::RULES) {
        for at in 0..70 {
            let stream = [&crowd[..at], &packet, &crowd[at..]].concat();
            check_slice::<F>(&stream);
        }
    }
}

fn check_every_cut<F: Known, const N: usize>() {
    let mut stream = crowd(60);
    stream.extend(packets(F::RULES).concat());
    stream.extend(crowd(60));
    for len in 0..stream.len() {
        check_slice::<F>(&stream[..len]);
        Line::<F, N>::new().play(&stream, &[Op::Slice(len), Op::Slice(stream.len())]);
    }
}
