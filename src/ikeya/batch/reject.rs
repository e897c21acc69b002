//! Refuses many bytes at once where headers stand thick.
//!
//! One look after the other costs two or three mispredicted branches a byte there. Here all places of
//! a block are judged together, header or not, and the processor has to foresee one thing of a block:
//! that nothing is in it. The loops are plain ones over arrays, which a compiler for a host turns
//! into vector instructions; on other machines nobody calls them.
//!
//! # What is computed
//!
//! As in [`crc16`](crate::crc16), a frame is a multiple of `T = x^15 + x + 1` with an even number of
//! ones, bit 0 of a word belongs to its highest power, and multiplying by `x` is a shift to the right.
//! The remainder modulo `T` of the bytes behind a place grows by a word at a time: times `x^16`, plus
//! the word.
//!
//! `x^16 = x^2 + x`: two shifts. They lose bit 0, which ought to become `x^16` and `x^17`, and bit 1,
//! which ought to become `x^16`: together `(x^2 + x)(b0 x + b0 + b1)`. So adding `b0 x + b0 + b1` to
//! the word beforehand makes up for it, and that is `(w << 14) + (w << 15)`.
//!
//! The initial value 0xFFFF, added to the first word, adds the same remainder to all windows of a
//! length; each is compared with that instead of with zero. Two values of 16 bits share a remainder of
//! 15, and they differ by `T`, which has three ones: those bits are left out of the comparison, and so is
//! parity. What passes without being right, 1 of 8192 windows by chance, is refused by a single look.

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

/// Places that are judged together: one half of them even, one odd.
const PLACES: usize = 32;

/// Words that begin at the places of a half, or behind the last of them in the longest packet.
const WORDS: usize = PLACES / 2 + three::WriteRequest::LEN / 2 - 1;

/// What a block can see, bytes.
const BLOCK: usize = 2 * WORDS + 1;

/// How many bytes at the front start no frame. Ends in front of the first that does, or where less
/// than a block is left.
#[inline(always)]
pub(super) fn reject_batch<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(
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

/// What a single look says.
#[inline(always)]
fn is_rejected<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
    at: usize,
) -> bool {
    let verdict = judge::<LONG, TO_SLAVE, TO_MASTER>(bytes.get(at..).unwrap_or_default());
    matches!(verdict, Verdict::Reject { reason: Reason::Crc | Reason::Header, .. })
}

/// Finds the places where a header stands, 1 for yes; how many there are.
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

/// Finds the places of a half where a window as long as a packet may be a multiple of `T`, 0xFFFF
/// for yes; all of them ORed.
#[inline(always)]
fn find_multiples<const LONG: usize, const TO_SLAVE: bool>(
    bytes: &[u8; 2 * WORDS],
    found: &mut [u16; PLACES / 2],
) -> u16 {
    const { assert!(LONG <= three::WriteRequest::LEN, "a block sees too little") }
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

/// `x^16 = x^2 + x`, for any word.
#[inline(always)]
const fn times_x16(word: u16) -> u16 {
    let word = word ^ (word << 14) ^ (word << 15);
    (word >> 2) ^ (word >> 1)
}
