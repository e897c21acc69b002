//! 64-bit words: for a host.

use super::narrow::TRINOMIAL;

#[inline(always)]
pub(super) const fn check(frame: &[u8]) -> bool {
    // A bus packet is one word, or half a word followed by zeros, which change nothing.
    if let Some((word, [])) = frame.split_first_chunk::<8>() {
        return divides(u64::from_le_bytes(*word) ^ 0xFFFF);
    }
    if let Some((word, [])) = frame.split_first_chunk::<4>() {
        return divides(u32::from_le_bytes(*word) as u64 ^ 0xFFFF);
    }
    let (state, parity) = residue(frame, 0);
    frame.len() >= 2 && !is_odd(parity) && reduce(fold(state)) == 0
}

#[cfg(feature = "ikeya")]
#[inline(always)]
pub(super) const fn check_packet<const LEN: usize>(packet: &[u8; LEN]) -> bool {
    check(packet)
}

#[inline(always)]
pub(super) const fn compute(bytes: &[u8]) -> u16 {
    // The length of most bus packets, without their CRC.
    if let (6, Some(low), Some(high)) = (bytes.len(), bytes.first_chunk(), bytes.last_chunk()) {
        return compute_6(u32::from_le_bytes(*low), u32::from_le_bytes(*high));
    }
    compute_any(bytes)
}

#[inline(never)]
const fn compute_any(bytes: &[u8]) -> u16 {
    let Some(last) = bytes.last_chunk::<8>() else { return compute_short(bytes) };
    // The last word ends in two zero bytes, which multiply by x^16.
    let word = u64::from_le_bytes(*last) >> 16;
    let (state, parity) = residue(bytes, 2);
    crc_of(word ^ times_x64(state), word ^ parity)
}

/// The message followed by `zeros` zero bytes, without the words that contain any of these: its
/// residue modulo the trinomial, not fully reduced, and the XOR of its words.
#[inline(always)]
const fn residue(bytes: &[u8], zeros: usize) -> (u64, u64) {
    let Some(first) = bytes.first_chunk::<8>() else { return residue_short(bytes) };
    // Zeros in front change nothing: pad so that only whole words follow.
    let head = (bytes.len() + zeros - 1) % 8 + 1;
    let mut state = (u64::from_le_bytes(*first) ^ 0xFFFF) << (64 - 8 * head);
    let mut parity = state;
    if head == 1 {
        // The second half of the initial value belongs to the second byte, in the next word.
        state ^= LATE;
    }
    let Some((_, mut words)) = bytes.split_at_checked(head) else { return (state, parity) };
    while let Some((&[a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p], rest)) =
        words.split_first_chunk::<16>()
    {
        let first = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        let second = u64::from_le_bytes([i, j, k, l, m, n, o, p]);
        parity ^= first ^ second;
        state = first ^ times_x64(state);
        state = second ^ times_x64(state);
        words = rest;
    }
    if let Some(word) = words.first_chunk::<8>() {
        let word = u64::from_le_bytes(*word);
        parity ^= word;
        state = word ^ times_x64(state);
    }
    (state, parity)
}

/// [`residue`] of less than a word.
#[inline(never)]
const fn residue_short(mut bytes: &[u8]) -> (u64, u64) {
    let (mut state, mut parity) = (INITIAL, 0);
    while let [byte, rest @ ..] = bytes {
        let word = (*byte as u64) << 56;
        parity ^= word;
        state = fold(word ^ state >> 8);
        bytes = rest;
    }
    (state, parity)
}

#[inline(never)]
const fn compute_short(bytes: &[u8]) -> u16 {
    let (state, parity) = residue_short(bytes);
    crc_of(state >> 2 ^ state >> 1, parity)
}

/// Six bytes, in 32-bit words. The product with x^16 does not overflow.
#[inline(always)]
const fn compute_6(first: u32, last: u32) -> u16 {
    let (low, high) = (first ^ 0xFFFF, last & 0xFFFF_0000);
    let state = fold_32(low);
    let product = state >> 4 ^ state >> 2 ^ high >> 2 ^ high >> 1;
    let remainder = fold_32(product);
    let odd = (low ^ high ^ remainder).count_ones() & 1 == 1;
    (remainder >> 16) as u16 ^ if odd { TRINOMIAL } else { 0 }
}

/// The CRC: the remainder of `product`, the message times x^16.
#[inline(always)]
const fn crc_of(product: u64, parity: u64) -> u16 {
    let remainder = reduce(fold(product));
    with_parity((remainder >> 48) as u16, parity ^ remainder)
}

/// Adds the trinomial to `remainder` if `parity` is odd: modulo the trinomial both are the same.
#[inline(always)]
const fn with_parity(remainder: u16, parity: u64) -> u16 {
    remainder ^ if is_odd(parity) { TRINOMIAL } else { 0 }
}

/// The state before the first byte: `0xFFFF · x^-16` modulo the trinomial. After the first two
/// bytes of a message of any length it has become the initial value 0xFFFF.
const INITIAL: u64 = 0xD556_0000_0000_0000;

/// What the initial value still adds after one byte: its first half is in already.
const LATE: u64 = INITIAL >> 8 ^ 0xFF << 56;

/// Whether the whole polynomial divides the word.
#[inline(always)]
const fn divides(word: u64) -> bool {
    let mut quotient = word;
    quotient ^= quotient >> 2 ^ quotient >> 15 ^ quotient >> 16;
    quotient ^= quotient >> 4 ^ quotient >> 30 ^ quotient >> 32;
    quotient ^= quotient >> 8 ^ quotient >> 60;
    quotient ^= quotient >> 16;
    quotient ^= quotient >> 32;
    quotient as u16 == 0
}

/// Times `x^64 = x^8 + x^4`.
#[inline(always)]
const fn times_x64(state: u64) -> u64 {
    let state = state ^ state << 56 ^ state << 60;
    state >> 8 ^ state >> 4
}

/// One reduction by `x^30 = x^2 + 1`: the first 28 bits become zero.
#[inline(always)]
const fn fold(word: u64) -> u64 {
    let moved = word << 30;
    (word & !((1 << 34) - 1)) ^ moved ^ moved >> 2
}

/// Reduces a folded word fully, by `x^15 = x + 1` twice: only the last 15 bits remain.
#[inline(always)]
const fn reduce(mut state: u64) -> u64 {
    let mut step = 0;
    while step < 2 {
        let moved = state << 15;
        state = (state & !((1 << 49) - 1)) ^ moved ^ moved >> 1;
        step += 1;
    }
    state
}

/// One reduction by `x^15 = x + 1`: the first 14 bits become zero.
#[inline(always)]
const fn fold_32(word: u32) -> u32 {
    let moved = word << 15;
    (word & !0x1_FFFF) ^ moved ^ moved >> 1
}

/// Whether the number of ones is odd.
#[inline(always)]
const fn is_odd(word: u64) -> bool {
    word.count_ones() & 1 == 1
}
