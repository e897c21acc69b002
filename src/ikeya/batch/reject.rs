//! Rejects many bytes at once where header bytes are dense.
//!
//! Judging one place after another costs two or three mispredicted branches per byte there. Here
//! all places of a block are judged together, header or not, so there is one branch to predict per
//! block: whether it contains a frame. The loops are plain loops over arrays, which a compiler for
//! a host vectorizes; other machines do not call them.
//!
//! # What is computed
//!
//! As in [`crc16`](crate::crc16), a frame is a multiple of `T = x^15 + x + 1` with an even number
//! of ones, bit 0 of a word belongs to its highest power, and multiplying by `x` is a shift to the
//! right. The remainder modulo `T` of the bytes after a place grows by one word at a time: times
//! `x^16`, plus the word.
//!
//! `x^16 = x^2 + x`: two shifts. They lose bit 0, which should become `x^16` and `x^17`, and bit 1,
//! which should become `x^16`: together `(x^2 + x)(b0 x + b0 + b1)`. Adding `b0 x + b0 + b1`, that
//! is `(w << 14) + (w << 15)`, to the word beforehand compensates for that.
//!
//! The initial value 0xFFFF, added to the first word, adds the same remainder to all windows of a
//! length; each is compared with that instead of with zero. Each 15-bit remainder is shared by two
//! 16-bit values, which differ by `T`. `T` has three ones: the comparison ignores those bits, and
//! parity. A single check rejects the false positives, by chance 1 in 8192 windows.

use zerocopy::{little_endian::U16, transmute_ref};

use crate::{
    crc16::TRINOMIAL,
    ikeya::{
        judge::judge,
        three,
        wire::{
            ReadRequest,
            header::{POSITION, READ, VELOCITY, WRITE},
        },
    },
    stream::{Reason, Rejected, Verdict},
};

/// Number of places judged together: half of them even, half odd.
const PLACES: usize = 32;

/// Words that begin at the places of a half, or after the last of them in the longest packet.
const WORDS: usize = PLACES / 2 + three::WriteRequest::LEN / 2 - 1;

/// Bytes that a block covers.
const BLOCK: usize = 2 * WORDS + 1;

/// Counts the bytes at the front that start no frame. Ends before the first that does, or where
/// less than a block is left.
#[inline(always)]
pub(crate) fn reject_batch<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
) -> Rejected {
    let mut rejected = Rejected::default();
    while let Some(block) = bytes.get(rejected.len..).and_then(|rest| rest.first_chunk::<BLOCK>()) {
        let mut headers = [0; PLACES];
        let crowd = find_headers::<TO_SLAVE, TO_MASTER>(block, &mut headers);
        let mut multiples = [[0; PLACES / 2]; 2];
        let [even, odd] = &mut multiples;
        let ([from_even @ .., _], [_, from_odd @ ..]) = (block, block);
        let any = find_multiples::<LONG, TO_SLAVE>(from_even, even)
            | find_multiples::<LONG, TO_SLAVE>(from_odd, odd);
        if any == 0 {
            rejected.len += PLACES;
            rejected.crc += usize::from(crowd);
            continue;
        }
        for (at, header) in headers.into_iter().enumerate() {
            if multiples[at % 2][at / 2] != 0
                && !is_rejected::<LONG, TO_SLAVE, TO_MASTER>(bytes, rejected.len)
            {
                return rejected;
            }
            rejected.len += 1;
            rejected.crc += usize::from(header);
        }
    }
    rejected
}

/// The verdict of a single check.
#[inline(always)]
fn is_rejected<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
    at: usize,
) -> bool {
    let verdict = judge::<LONG, TO_SLAVE, TO_MASTER>(bytes.get(at..).unwrap_or_default());
    matches!(verdict, Verdict::Reject { reason: Reason::Crc | Reason::Header, .. })
}

/// Marks the places of headers with 1; returns their number.
#[inline(always)]
fn find_headers<const TO_SLAVE: bool, const TO_MASTER: bool>(
    block: &[u8; BLOCK],
    found: &mut [u8; PLACES],
) -> u8 {
    let mut count = 0;
    for (found, &byte) in found.iter_mut().zip(block) {
        let mut header = 0;
        if TO_SLAVE {
            header |= u8::from(byte == READ) | u8::from(byte == WRITE);
        }
        if TO_MASTER {
            header |= u8::from(byte == VELOCITY) | u8::from(byte == POSITION);
        }
        *found = header;
        count += header;
    }
    count
}

/// Marks with 0xFFFF the places of a half at which a window as long as a packet may be a multiple
/// of `T`; returns the marks ORed together.
#[inline(always)]
fn find_multiples<const LONG: usize, const TO_SLAVE: bool>(
    bytes: &[u8; 2 * WORDS],
    found: &mut [u16; PLACES / 2],
) -> u16 {
    const { assert!(LONG <= three::WriteRequest::LEN, "the block is too short") }
    let words: &[U16; WORDS] = transmute_ref!(bytes);
    let mut any = 0;
    for lane in 0..PLACES / 2 {
        let (mut remainder, mut initial) = (words[lane].get(), 0xFFFF);
        let mut multiple = 0;
        for next in 1..LONG / 2 {
            remainder = times_x16(remainder) ^ words[lane + next].get();
            initial = times_x16(initial);
            let len = 2 * next + 2;
            if len == LONG || (TO_SLAVE && len == ReadRequest::LEN) {
                multiple |= flag((remainder ^ initial) & !TRINOMIAL == 0);
            }
        }
        found[lane] = multiple;
        any |= multiple;
    }
    any
}

#[inline(always)]
const fn flag(is_set: bool) -> u16 {
    if is_set { 0xFFFF } else { 0 }
}

/// Multiplies a word by `x^16 = x^2 + x`.
#[inline(always)]
const fn times_x16(word: u16) -> u16 {
    let word = word ^ (word << 14) ^ (word << 15);
    (word >> 2) ^ (word >> 1)
}
