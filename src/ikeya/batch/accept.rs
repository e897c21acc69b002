//! Finds packets that follow each other closely, many at once.
//!
//! Works in lanes of 32 bits, like `crc16` on a microcontroller: one step handles as many lanes as
//! a register holds. The loops are plain loops over arrays, which the compiler vectorizes.

use zerocopy::{little_endian::U32, transmute_ref};

use crate::{
    crc16,
    ikeya::wire::{
        ReadRequest, VelocityResponse,
        header::{POSITION, READ, VELOCITY, WRITE},
    },
    stream::Accepted,
};

/// Number of words judged together as starts of packets; one bit in a mask for each.
const PLACES: usize = 32;

/// All even places.
const EVEN: u32 = 0x5555_5555;

/// One word more than a block: the last place needs it.
type Block = [U32; PLACES + 1];

/// Length of a block, bytes.
const BLOCK: usize = 4 * PLACES;

/// This many packets of 8 bytes at the front are a run of their own, whatever follows.
const WORTH: usize = 3;

/// The packets at the front that directly follow each other.
///
/// Finds packets of 8 bytes with a valid CRC; their header and id are checked when they are handed
/// out. If there are hardly any and registers are wide, it finds complete and correct packets of
/// both lengths. In narrower registers those cost more than they gain, since a packet may begin at
/// every place.
#[inline(always)]
pub(super) fn accept_batch<const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
    is_wide: bool,
) -> Accepted {
    let Some(bytes) = bytes.first_chunk::<{ BLOCK + 4 }>() else { return Accepted::default() };
    let block: &Block = transmute_ref!(bytes);
    let evens = right_longs(block, 0);
    let frames = ((evens | !EVEN).trailing_ones() / 2) as usize;
    if TO_SLAVE && is_wide && frames < WORTH {
        return both_lengths::<TO_MASTER>(block, evens);
    }
    Accepted { frames, len: frames * VelocityResponse::LEN }
}

/// The packets of both lengths at the front; `evens` are the even places with a valid CRC.
#[inline(always)]
fn both_lengths<const TO_MASTER: bool>(block: &Block, evens: u32) -> Accepted {
    let right = evens | right_longs(block, 1);
    let longs = right & mask(block, starts_long::<TO_MASTER>);
    let shorts = mask(block, |word| read_mismatch(word) == 0);
    // A place that no earlier packet leads to is behind damage or inside a packet.
    let led_to = 1 | longs << 2 | shorts << 1;
    let loose = (longs | shorts) & !led_to;
    let in_front = (loose & loose.wrapping_neg()).wrapping_sub(1);
    let longs = (longs & in_front).count_ones() as usize;
    let shorts = (shorts & in_front).count_ones() as usize;
    Accepted {
        frames: longs + shorts,
        len: longs * VelocityResponse::LEN + shorts * ReadRequest::LEN,
    }
}

/// The even places (or, with `from` 1, the odd ones) whose 8 bytes end in their CRC.
#[inline(always)]
fn right_longs(block: &Block, from: usize) -> u32 {
    let mut found = 0;
    for pair in 0..PLACES / 2 {
        let place = 2 * pair + from;
        let syndrome = crc16::syndrome_8(block[place].get(), block[place + 1].get());
        found |= if syndrome == 0 { 1 << place } else { 0 };
    }
    found
}

/// The places whose word satisfies `is_one`.
#[inline(always)]
fn mask(block: &Block, is_one: impl Fn(u32) -> bool) -> u32 {
    let mut found = 0;
    for (place, word) in block.iter().take(PLACES).enumerate() {
        found |= if is_one(word.get()) { 1 << place } else { 0 };
    }
    found
}

/// Whether a packet of 8 bytes can start with this word.
#[inline(always)]
fn starts_long<const TO_MASTER: bool>(word: u32) -> bool {
    let is = |header| start_mismatch(word, header) == 0;
    is(WRITE) | (TO_MASTER & (is(VELOCITY) | is(POSITION)))
}

/// Zero for a READ.
#[inline(always)]
fn read_mismatch(word: u32) -> u32 {
    crc16::syndrome_4(word) | start_mismatch(word, READ)
}

/// Zero for this header with an id of 1 to 8. Not bytewise, which would take the lanes apart.
#[inline(always)]
fn start_mismatch(word: u32, header: u8) -> u32 {
    ((word << 16).wrapping_sub(0x0100_0000) & 0xF8FF_0000) ^ u32::from(header) << 16
}
