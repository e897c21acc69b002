//! Refuses many bytes at once, on a host: sixteen places are judged together and without a branch.
//!
//! Where headers stand thick, one judgement after the other costs two or three mispredicted branches
//! a byte. Here every place of a block, header or not, gets the remainders of the short and the long
//! window that begin at it, and the processor learns one thing of the block: is there a multiple?
//!
//! # Why the remainders are right
//!
//! As in [`crc16`](crate::crc16), a frame is a multiple of `T = x^15 + x + 1` with an even number of
//! ones, bit 0 of a word belongs to its highest power, and multiplying by `x` is a shift to the right.
//!
//! * `x^16 = x^2 + x`, so a word times `x^16` is `(w >> 2) ^ (w >> 1)`, but for the bits that these
//!   shifts lose: bit 0 twice and bit 1 once, the powers `x^17`, `x^16` and `x^16`. They are
//!   `x^2 · T`-equal to what two bits further left would have given: adding `(w << 15) ^ (w << 14)`
//!   to the word beforehand adds a multiple of `T` that clears them.
//! * Squaring doubles every exponent: `x^32 = x^4 + x^2` and `x^64 = x^8 + x^4`, likewise.
//! * So from the words at a place and behind it come the remainders of 4, then 8, then 16 bytes.
//!   The initial value 0xFFFF on the first word adds a constant.
//! * 15 bits are a remainder; two values of 16 share it, and they differ by `T` itself.
//!
//! The parity is left out: a multiple of `T` at a header is shown to `judge`, whether good or not.

use zerocopy::{little_endian::U16, transmute_ref};

use super::wire::header::{POSITION, READ, VELOCITY, WRITE};
use crate::stream::{Framing, Reason, Swept, Verdict};

/// Places that are judged together.
const PLACES: usize = 32;

/// Words that begin at every second place of a block or belong to a packet that does.
const WORDS: usize = PLACES / 2 + 7;

/// Bytes that a block can see: the last place may begin a packet of 16, the longest that there is.
const BLOCK: usize = 2 * WORDS + 1;

/// How many bytes at the front start no frame.
#[inline(always)]
pub(super) fn sweep<F: Framing, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
) -> Swept {
    let mut swept = Swept::default();
    while let Some(block) = bytes.get(swept.len..).and_then(|rest| rest.first_chunk::<BLOCK>()) {
        let mut headers = [0; PLACES];
        let mut multiples = [[0; PLACES / 2]; 2];
        let candidates = find_headers::<TO_SLAVE, TO_MASTER>(block, &mut headers);
        let [even, odd] = &mut multiples;
        let any = find_multiples::<F, TO_SLAVE>(block.first_chunk(), even)
            | find_multiples::<F, TO_SLAVE>(block.last_chunk(), odd);
        if any {
            for (at, header) in headers.into_iter().enumerate() {
                if multiples[at % 2][at / 2] != 0 {
                    let candidate = bytes.get(swept.len..).unwrap_or_default();
                    match F::judge(candidate) {
                        Verdict::Reject { reason: Reason::Crc | Reason::Header, .. } => {}
                        _ => return swept,
                    }
                }
                swept.len += 1;
                swept.crc += usize::from(header);
            }
        } else {
            swept.len += PLACES;
            swept.crc += usize::from(candidates);
        }
    }
    swept
}

/// Marks the places where a header stands with 1; how many there are.
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

/// Marks the places, every second one of a block, where a window of a length that occurs is a
/// multiple of the trinomial once the initial value is added; says whether there is any.
#[inline(always)]
fn find_multiples<F: Framing, const TO_SLAVE: bool>(
    block: Option<&[u8; 2 * WORDS]>,
    found: &mut [u16; PLACES / 2],
) -> bool {
    let Some(block) = block else { return true };
    let words: &[U16; WORDS] = transmute_ref!(block);
    let mut any = 0;
    for lane in 0..PLACES / 2 {
        let mut remainder = words[lane].get();
        let mut initial = 0xFFFF;
        let mut multiple = 0;
        for next in 1..F::MAX_LEN / 2 {
            remainder = times_x16(remainder) ^ words[lane + next].get();
            initial = times_x16(initial);
            if next + 1 == F::MAX_LEN / 2 || (TO_SLAVE && next == 1) {
                multiple |= flag(remainder == initial) | flag(remainder == initial ^ TRINOMIAL);
            }
        }
        found[lane] = multiple;
        any |= multiple;
    }
    any != 0
}

#[inline(always)]
const fn flag(is: bool) -> u16 {
    if is { 0xFFFF } else { 0 }
}

/// `x^15 + x + 1`.
const TRINOMIAL: u16 = 0xC001;

/// `x^16 = x^2 + x`, modulo the trinomial.
#[inline(always)]
const fn times_x16(word: u16) -> u16 {
    let word = word ^ (word << 15) ^ (word << 14);
    (word >> 1) ^ (word >> 2)
}
