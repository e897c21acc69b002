//! Packets of 4 and 8 bytes judged in AVX2 lanes, four at a time.

use super::{
    NodeId, ReadRequest,
    wire::header::{POSITION, READ, VELOCITY, WRITE},
};
use crate::{
    crc16,
    simd::{Avx2, Lanes, with_avx2},
    stream::{Ahead, Framing, Reason, Swept, Verdict},
};

/// Places that are judged together, a bit in a word for each.
const PLACES: usize = 64;

/// Longest packet, bytes.
const LONG: usize = 8;

/// What the last of the places can see of its packet.
const BLOCK: usize = PLACES + LONG - 1;

/// The packets at the front that are whole and right, one behind the other.
#[inline(never)]
pub(super) fn look_ahead<const TO_SLAVE: bool, const TO_MASTER: bool>(bytes: &[u8]) -> Ahead {
    let Some(block) = bytes.first_chunk::<BLOCK>() else { return Ahead::default() };
    with_avx2(
        #[inline(always)]
        |simd| ahead_in::<TO_SLAVE, TO_MASTER>(simd, block),
    )
    .unwrap_or_default()
}

#[inline(always)]
fn ahead_in<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, block: &[u8; BLOCK]) -> Ahead {
    /// Every eighth place.
    const ALL: u64 = 0x0101_0101_0101_0101;
    let [first, second] = [0, 32].map(|at| simd.load(block, at));
    let right = [first, second].map(|lanes| right_long::<TO_SLAVE, TO_MASTER>(simd, lanes));
    let long = simd.places(right);
    if long == ALL || !TO_SLAVE {
        return Ahead { long, short: 0 };
    }
    // There are READs of four bytes among them: every fourth place.
    let between = [4, 36].map(|at| right_long::<TO_SLAVE, TO_MASTER>(simd, simd.load(block, at)));
    let long = long | simd.places(between) << 4;
    let reads = [first, second].map(|lanes| {
        let reads = READS.map(|read| simd.is_equal_u32(lanes, simd.each(read)));
        let is_read = reads.into_iter().reduce(|a, b| simd.or(a, b));
        simd.and(is_read.unwrap_or(lanes), simd.each(0xFF_0000_00FF))
    });
    Ahead { long, short: simd.places(reads) }
}

/// All READs that there are, twice in a word.
const READS: [u64; NodeId::ALL.len()] = {
    let mut reads = [0; NodeId::ALL.len()];
    let mut at = 0;
    while at < reads.len() {
        let [id, _] = (at as u16 + 1).to_le_bytes();
        let [low, high] = crc16::compute(&[READ, id]).to_le_bytes();
        let read = u32::from_le_bytes([READ, id, low, high]) as u64;
        reads[at] = read << 32 | read;
        at += 1;
    }
    reads
};

/// Marks the first byte of each word that is a whole packet of 8 bytes.
#[inline(always)]
fn right_long<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, packets: Lanes) -> Lanes {
    let is_id = simd.is_in(packets, 1, 8);
    let is_header = is_long_header::<TO_SLAVE, TO_MASTER>(simd, packets);
    let is_right = simd.is_zero_u16(quotient(simd, simd.xor(packets, simd.each(0xFFFF))));
    let is_packet = simd.and(simd.and(is_header, simd.shr::<8>(is_id)), is_right);
    simd.and(is_packet, simd.each(0xFF))
}

/// The headers of packets of 8 bytes.
#[inline(always)]
fn is_long_header<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, lanes: Lanes) -> Lanes {
    let of_master = simd.is(lanes, WRITE);
    let of_slave = simd.or(simd.is(lanes, VELOCITY), simd.is(lanes, POSITION));
    match (TO_SLAVE, TO_MASTER) {
        (true, true) => simd.or(of_master, of_slave),
        (true, false) => of_master,
        (false, _) => of_slave,
    }
}

/// The message divided by the polynomial as a power series, up to `x^63`: 16 zeros at the end, its
/// low bits, say that the division leaves nothing.
///
/// `1 / P = (1 + x^2 + x^15 + x^16) · (1 + x^4 + x^30 + x^32) · …`, as squaring doubles every exponent
/// and `P · P^-1 = 1`; powers above 63 are left out. Multiplying by `x` is a shift to the right.
#[inline(always)]
fn quotient(simd: Avx2, message: Lanes) -> Lanes {
    let add = |sum, more| simd.xor(sum, more);
    let mut q = message;
    q = add(add(q, simd.shr::<2>(q)), add(simd.shr::<15>(q), simd.shr::<16>(q)));
    q = add(add(q, simd.shr::<4>(q)), add(simd.shr::<30>(q), simd.shr::<32>(q)));
    q = add(add(q, simd.shr::<8>(q)), simd.shr::<60>(q));
    q = add(q, simd.shr::<16>(q));
    add(q, simd.shr::<32>(q))
}

/// Refuses bytes at the front until a packet with a right CRC stands there, or few are left.
#[inline(always)]
pub(super) fn sweep<F: Framing, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
) -> Swept {
    if bytes.len() < BLOCK {
        return Swept::default();
    }
    with_avx2(
        #[inline(always)]
        |simd| sweep_in::<F, TO_SLAVE, TO_MASTER>(simd, bytes),
    )
    .unwrap_or_default()
}

#[inline(always)]
fn sweep_in<F: Framing, const TO_SLAVE: bool, const TO_MASTER: bool>(
    simd: Avx2,
    bytes: &[u8],
) -> Swept {
    let mut swept = Swept::default();
    let mut rest = bytes;
    while let Some(block) = rest.first_chunk::<BLOCK>() {
        let headers = headers::<TO_SLAVE, TO_MASTER>(simd, block);
        let mut left = headers;
        // Four candidates in any case: noise has one in a block, or none, or two, and how many cannot
        // be foreseen. Those that are none are place 0.
        loop {
            let at: [usize; 4] = core::array::from_fn(|_| {
                let at = left.trailing_zeros() as usize % PLACES;
                left &= left.wrapping_sub(1);
                at
            });
            let mut hits = are_right::<TO_SLAVE>(simd, at.map(|at| word(block, at)));
            while hits != 0 {
                let place = at[hits.trailing_zeros() as usize / 8 % 4];
                let candidate = rest.get(place..).unwrap_or_default();
                let is_refused = matches!(
                    F::judge(candidate),
                    Verdict::Reject { reason: Reason::Header | Reason::Crc, .. }
                );
                if !is_refused {
                    let before = headers & !(u64::MAX << place);
                    swept.len += place;
                    swept.crc += before.count_ones() as usize;
                    return swept;
                }
                hits &= hits - 1;
            }
            if left == 0 {
                break;
            }
        }
        swept.len += PLACES;
        swept.crc += headers.count_ones() as usize;
        rest = rest.get(PLACES..).unwrap_or_default();
    }
    swept
}

/// The places where a header stands.
#[inline(always)]
fn headers<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, block: &[u8; BLOCK]) -> u64 {
    simd.places([0, 32].map(|at| {
        let lanes = simd.load(block, at);
        let is_long = is_long_header::<TO_SLAVE, TO_MASTER>(simd, lanes);
        if TO_SLAVE { simd.or(is_long, simd.is(lanes, READ)) } else { is_long }
    }))
}

/// The eight bytes from a place on.
#[inline(always)]
fn word(block: &[u8; BLOCK], at: usize) -> u64 {
    let packet = block.get(at..).and_then(<[u8]>::first_chunk::<LONG>);
    packet.map_or(0, |packet| u64::from_le_bytes(*packet))
}

/// A bit for each byte, the first of a word set where it begins a packet with a right CRC.
#[inline(always)]
fn are_right<const TO_SLAVE: bool>(simd: Avx2, words: [u64; 4]) -> u32 {
    let packets = simd.words(words);
    let mut message = simd.xor(packets, simd.each(0xFFFF));
    if TO_SLAVE {
        // Of a READ, only the first half is there: zeros in front of it say nothing.
        let half = const { 8 * (LONG - ReadRequest::LEN) as u64 };
        let bits = simd.and(simd.is(packets, READ), simd.each(half));
        message = simd.shl_by(message, bits);
    }
    let is_right = simd.is_zero_u16(quotient(simd, message));
    simd.mask(is_right) & 0x0101_0101
}
