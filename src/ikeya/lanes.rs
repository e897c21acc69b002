//! Packets of 4 and 8 bytes judged in AVX2 lanes, four at a time.

use super::{
    NodeId, ReadRequest,
    wire::header::{POSITION, READ, VELOCITY, WRITE},
};
use crate::{
    crc16,
    simd::{Avx2, Lanes, with_avx2},
    stream::{Framing, GoodRun, Reason, Swept, Verdict},
};

/// Places that are judged together, a bit in a word for each.
const PLACES: usize = 64;

/// Longest packet, bytes.
const LONG: usize = 8;

/// What the last of the places can see of its packet.
const BLOCK: usize = PLACES + LONG - 1;

/// The packets at the front that are whole and right, one behind the other.
#[inline(always)]
pub(super) fn good_run<const TO_SLAVE: bool, const TO_MASTER: bool>(bytes: &[u8]) -> GoodRun {
    if bytes.len() < BLOCK {
        return GoodRun::default();
    }
    with_avx2(
        #[inline(always)]
        |simd| run_in::<TO_SLAVE, TO_MASTER>(simd, bytes),
    )
    .unwrap_or_default()
}

/// Blocks that are looked at together. More would bring little, and what a user has not taken when he
/// asks for the counters has to be counted again.
const BLOCKS: usize = 4;

#[inline(always)]
fn run_in<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, bytes: &[u8]) -> GoodRun {
    /// Every eighth place.
    const ALL: u64 = 0x0101_0101_0101_0101;
    let mut run = GoodRun::default();
    // Blocks lie where they lie, whatever was found in the one before: no look waits for another.
    for number in 0..BLOCKS {
        let start = number * PLACES;
        let Some(block) = bytes.get(start..).and_then(<[u8]>::first_chunk) else { break };
        let at = run.len - start;
        let mut long = right_long_at::<TO_SLAVE, TO_MASTER>(simd, block, 0);
        if at == 0 && long == ALL {
            run.frames += PLACES / LONG;
            run.len += PLACES;
            continue;
        }
        let mut short = 0;
        let first_other = (long ^ ALL).trailing_zeros() as usize;
        if TO_SLAVE && (at != 0 || block.get(first_other) == Some(&READ)) {
            // Packets of four bytes are among them: then every fourth place counts.
            long |= right_long_at::<TO_SLAVE, TO_MASTER>(simd, block, 4) << 4;
            let first = right_short(simd, simd.load(block, 0));
            short = simd.places([first, right_short(simd, simd.load(block, 32))]);
        }
        // Whatever no packet in front of it leads to is behind damage, or inside a packet.
        let led_to = 1 << at | long << LONG | short << ReadRequest::LEN;
        let loose = (long | short) & !led_to;
        let in_front = (loose & loose.wrapping_neg()).wrapping_sub(1);
        let longs = (long & in_front).count_ones() as usize;
        let shorts = (short & in_front).count_ones() as usize;
        run.frames += longs + shorts;
        run.len += longs * LONG + shorts * ReadRequest::LEN;
        run.is_cut = run.len < start + PLACES;
        if run.is_cut {
            break;
        }
    }
    run
}

/// The places among every eighth one, from `at` on, where a packet of 8 bytes begins.
///
/// Header and id of all eight packets share a register, and so do what is left of the divisions.
#[inline(always)]
fn right_long_at<const TO_SLAVE: bool, const TO_MASTER: bool>(
    simd: Avx2,
    block: &[u8; BLOCK],
    at: usize,
) -> u64 {
    let (first, second) = (simd.load(block, at), simd.load(block, at + 32));
    let starts = simd.low_halves(first, second);
    let is_id = simd.is_in(starts, 1, 8);
    let is_header = is_long_header::<TO_SLAVE, TO_MASTER>(simd, starts);

    let initial = simd.each(0xFFFF);
    let first = quotient(simd, simd.xor(first, initial));
    let second = quotient(simd, simd.xor(second, initial));
    let is_right = end_is_zero(simd, simd.low_halves(first, second));

    let is_packet = simd.and(simd.and(is_header, simd.shr::<8>(is_id)), is_right);
    let marks = u64::from(simd.mask(is_packet));
    marks & 0x0101_0101 | (marks >> 4 & 0x0101_0101) << 32
}

/// Marks the first byte of each half of a word that is a READ.
#[inline(always)]
fn right_short(simd: Avx2, lanes: Lanes) -> Lanes {
    /// All READs that there are, twice in a word.
    const READS: [u64; NodeId::ALL.len()] = {
        let mut reads = [0; NodeId::ALL.len()];
        let mut at = 0;
        while at < reads.len() {
            let id = at as u8 + 1;
            let [low, high] = crc16::compute(&[READ, id]).to_le_bytes();
            let read = u32::from_le_bytes([READ, id, low, high]) as u64;
            reads[at] = read << 32 | read;
            at += 1;
        }
        reads
    };
    let mut is_read = simd.each(0);
    for read in READS {
        is_read = simd.or(is_read, simd.is_equal_u32(lanes, simd.each(read)));
    }
    simd.and(is_read, simd.each(0x0000_00FF_0000_00FF))
}

#[inline(always)]
fn is_header<const TO_SLAVE: bool, const TO_MASTER: bool>(simd: Avx2, lanes: Lanes) -> Lanes {
    let is_long = is_long_header::<TO_SLAVE, TO_MASTER>(simd, lanes);
    if TO_SLAVE { simd.or(is_long, simd.is(lanes, READ)) } else { is_long }
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

/// The message divided by the polynomial as a power series, up to `x^63`, but for the last steps: what
/// they need is in the low half of a word, and [`end_is_zero`] takes them.
///
/// `1 / P = (1 + x^2 + x^15 + x^16) · (1 + x^4 + x^30 + x^32) · …`, as squaring doubles every exponent
/// and the products approach `P · P^-1 = 1`; powers above 63 are left out. Multiplying by `x` is a shift
/// to the right.
#[inline(always)]
fn quotient(simd: Avx2, message: Lanes) -> Lanes {
    let add = |sum, more| simd.xor(sum, more);
    let mut q = message;
    q = add(add(q, simd.shr::<2>(q)), add(simd.shr::<15>(q), simd.shr::<16>(q)));
    q = add(add(q, simd.shr::<4>(q)), add(simd.shr::<30>(q), simd.shr::<32>(q)));
    q = add(add(q, simd.shr::<8>(q)), simd.shr::<60>(q));
    add(q, simd.shr::<32>(q))
}

/// 0xFFFF in the low 16 bits of each half of a word where those of the quotient are zero: nothing is
/// left of the division. Other bits say nothing.
#[inline(always)]
fn end_is_zero(simd: Avx2, quotient: Lanes) -> Lanes {
    simd.is_zero_u16(simd.xor(quotient, simd.shr::<16>(quotient)))
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
    let first = is_header::<TO_SLAVE, TO_MASTER>(simd, simd.load(block, 0));
    simd.places([first, is_header::<TO_SLAVE, TO_MASTER>(simd, simd.load(block, 32))])
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
    simd.mask(end_is_zero(simd, quotient(simd, message))) & 0x0101_0101
}
