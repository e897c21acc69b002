//! What a SIMD path would bring: packets of eight bytes, one behind the other, checked eight at a time.
//!
//! axlewire has none. This is the best case for one, built as it would have to be: no `unsafe`, the
//! instruction set chosen at run time by `pulp`. Each line is `name value`, times faster than
//! `Frames`, medians of rounds in turns; `BENCHMARKS.md` says what follows from them.

use std::env;

use axlewire::{
    ikeya::{Either, MAX_LEN},
    stream::Framing,
};
use axlewire_benches::{
    Tally,
    ours::{self, Sample},
    race::{Contender, race},
    streams,
};

/// Packets that are checked together.
const BATCH: usize = 8;

fn main() {
    let given = |wanted: &str| env::args().any(|argument| argument == wanted);
    let (len, rounds) =
        if given("--bench") && !given("--test") { (64 << 20, 15) } else { (1 << 16, 1) };
    let stream = streams::responses(len);
    let (bytes, all) = (&stream.bytes[..], (stream.protocol.oracle)(&stream.bytes));
    let arch = pulp::Arch::new();
    let in_simd = |batch: &[u8]| {
        arch.dispatch(
            #[inline(always)]
            || are_good(batch),
        )
    };
    // A check that lets everything pass must not be what is measured.
    let mut damaged = bytes[..BATCH * MAX_LEN].to_vec();
    damaged[MAX_LEN + 3] ^= 1;
    assert!(!are_good(&damaged) && !in_simd(&damaged));

    let [frames, checked, checked_in_simd, handed_out, handed_out_in_simd] = race(
        rounds,
        [
            Contender::new("Frames", all, || (stream.protocol.frames)(bytes)),
            Contender::new("check", counted(bytes), || count(bytes, are_good)),
            Contender::new("check, SIMD", counted(bytes), || count(bytes, in_simd)),
            Contender::new("hand out", all, || hand_out(bytes, are_good)),
            Contender::new("hand out, SIMD", all, || hand_out(bytes, in_simd)),
        ],
    );
    println!("checked_over_frames {:.2}", frames / checked);
    println!("checked_simd_over_frames {:.2}", frames / checked_in_simd);
    println!("handed_out_over_frames {:.2}", frames / handed_out);
    println!("handed_out_simd_over_frames {:.2}", frames / handed_out_in_simd);
}

/// Only looks at the packets: the limit of what can be reached.
fn count(bytes: &[u8], are_good: impl Fn(&[u8]) -> bool) -> Tally {
    let good = bytes.chunks(BATCH * MAX_LEN).filter(|batch| are_good(batch)).count();
    Tally { frames: good as u64, sum: 0 }
}

fn counted(bytes: &[u8]) -> Tally {
    Tally { frames: bytes.chunks(BATCH * MAX_LEN).len() as u64, sum: 0 }
}

/// Hands out each packet, as `Frames` does.
fn hand_out(bytes: &[u8], are_good: impl Fn(&[u8]) -> bool) -> Tally {
    let mut tally = Tally::default();
    for batch in bytes.chunks(BATCH * MAX_LEN) {
        if are_good(batch) {
            let packets = batch.chunks_exact(MAX_LEN).filter_map(Either::view);
            packets.for_each(|packet| packet.add_to(&mut tally));
        } else {
            let found = ours::frames::<Either>(batch);
            tally.frames += found.frames;
            tally.sum = tally.sum.wrapping_add(found.sum);
        }
    }
    tally
}

/// Are these whole packets of eight bytes with known headers and ids and right CRCs?
#[inline(always)]
fn are_good(batch: &[u8]) -> bool {
    let (packets, rest) = batch.as_chunks();
    let bad = packets.iter().fold(0, |bad, packet| bad | flaws(u64::from_le_bytes(*packet)));
    bad == 0 && rest.is_empty()
}

/// Zero for a good packet. No branches and no counting of ones, so that it can be done in lanes; the
/// CRC as in `axlewire::crc16`.
#[inline(always)]
fn flaws(packet: u64) -> u64 {
    let is = |value: u64, wanted: u64| (value ^ wanted).wrapping_sub(1) >> 63;
    let header = packet & 0xFF;
    let is_known = is(header, 0x55) | is(header, 0x56) | is(header, 0xBB);
    let id_is_wrong = ((packet >> 8 & 0xFF).wrapping_sub(1)) >> 3;

    let word = packet ^ 0xFFFF;
    let parity = [32, 16, 8, 4, 2, 1].into_iter().fold(word, |bits, half| bits ^ bits >> half) & 1;
    let moved = word << 30;
    let mut state = (word & !((1 << 34) - 1)) ^ moved ^ (moved >> 2);
    for _ in 0..2 {
        let moved = state << 15;
        state = (state & !((1 << 49) - 1)) ^ moved ^ (moved >> 1);
    }
    (is_known ^ 1) | id_is_wrong | parity | state
}
