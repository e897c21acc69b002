//! 32-bit words: for a microcontroller, and for the lanes of a host.

#![cfg_attr(target_pointer_width = "64", allow(dead_code, reason = "a host uses only the lanes"))]

/// `x^15 + x + 1`, a factor of the polynomial.
#[cfg(any(test, target_pointer_width = "64", feature = "ikeya"))]
pub(crate) const TRINOMIAL: u16 = 0xC001;

/// Zero for a good frame of 4 bytes, one word.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn syndrome_4(word: u32) -> u32 {
    syndrome(word ^ 0xFFFF)
}

/// Zero for a good frame of 8 bytes, two words. Branch-free, so it vectorizes.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn syndrome_8(first: u32, second: u32) -> u32 {
    syndrome(times_x32(first ^ 0xFFFF) ^ second)
}

#[inline(always)]
pub(super) const fn check(frame: &[u8]) -> bool {
    frame.len() >= 2 && syndrome(residue(frame)) == 0
}

/// One or two words, without a loop.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(super) const fn check_packet<const LEN: usize>(packet: &[u8; LEN]) -> bool {
    let Some((first, rest)) = packet.split_first_chunk() else { return check(packet) };
    let first = u32::from_le_bytes(*first);
    match rest {
        [] => syndrome_4(first) == 0,
        &[a, b, c, d] => syndrome_8(first, u32::from_le_bytes([a, b, c, d])) == 0,
        _ => check(packet),
    }
}

#[inline(always)]
pub(super) const fn compute(bytes: &[u8]) -> u16 {
    remainder(times_x16(residue(bytes)))
}

/// The message modulo the polynomial, not fully reduced.
#[inline(always)]
const fn residue(bytes: &[u8]) -> u32 {
    let (Some(first), [_, rest @ ..]) = (bytes.first_chunk(), bytes) else {
        return residue_short(bytes);
    };
    // Zeros in front change nothing: pad so that whole words follow the first byte and the odd
    // ones.
    let (whole, odd) = (rest.len() & !3, rest.len() % 4);
    let mut state = (u32::from_le_bytes(*first) ^ 0xFFFF) << (24 - 8 * odd);
    if odd == 0 {
        // The second half of the initial value belongs to the second byte, in the next word.
        state ^= LATE;
    }
    let Some((_, mut words)) = bytes.split_at_checked(bytes.len() - whole) else {
        return state;
    };
    while let Some((word, rest)) = words.split_first_chunk() {
        state = u32::from_le_bytes(*word) ^ times_x32(state);
        words = rest;
    }
    state
}

/// [`residue`] of less than a word.
#[inline(never)]
const fn residue_short(mut bytes: &[u8]) -> u32 {
    let mut state = INITIAL;
    while let [byte, rest @ ..] = bytes {
        state = (*byte as u32) << 24 ^ times_x8(state);
        bytes = rest;
    }
    state
}

/// The state before the first byte: `0xFFFF · x^-16`. After the first two bytes of a message of any
/// length it has become the initial value 0xFFFF.
const INITIAL: u32 = 0x1557_0000;

/// What the initial value still adds after one byte: its first half is in already.
const LATE: u32 = times_x8(INITIAL) ^ 0xFF << 24;

/// Times `x^32 = x^16 + x^4 + x`.
#[inline(always)]
const fn times_x32(state: u32) -> u32 {
    let state = state ^ state << 16 ^ state << 28 ^ state << 31;
    state >> 16 ^ state >> 4 ^ state >> 1
}

/// Times `x^16`. The bits shifted out are a multiple of `x^32` again.
#[inline(always)]
const fn times_x16(state: u32) -> u32 {
    state >> 16 ^ times_x32(state << 16)
}

#[inline(always)]
const fn times_x8(state: u32) -> u32 {
    state >> 8 ^ times_x32(state << 24)
}

/// Zero for a multiple of the polynomial: the last 16 coefficients of the quotient.
#[inline(always)]
const fn syndrome(word: u32) -> u32 {
    let mut quotient = word;
    quotient ^= quotient >> 2 ^ quotient >> 15 ^ quotient >> 16;
    quotient ^= quotient >> 4 ^ quotient >> 30;
    quotient ^= quotient >> 8;
    quotient ^= quotient >> 16;
    quotient << 16
}

/// Remainder of the word: the word minus the polynomial times the quotient.
#[inline(always)]
const fn remainder(word: u32) -> u16 {
    let mut quotient = word;
    quotient ^= quotient << 1 ^ quotient << 14;
    quotient ^= quotient << 2;
    quotient ^= quotient << 4;
    quotient ^= quotient << 8;
    let quotient = quotient as u16;
    (word >> 16) as u16 ^ quotient ^ quotient >> 2 ^ quotient >> 15
}
