//! CRC-16/MODBUS without a table (ruling B1).
//!
//! Both protocols end every frame with this checksum, low byte first: polynomial 0x8005 sent
//! least significant bit first (0xA001 reflected), initial value 0xFFFF, no final XOR. The
//! catalogue's check value, the CRC of `123456789`, is 0x4B37.
//!
//! # How it works
//!
//! A message is a polynomial over the field of two elements: the first bit sent is the coefficient of
//! the highest power, and a frame is good when `P = x^16 + x^15 + x^2 + 1` divides it. Words are read
//! little-endian, so bit 0 of a word was sent first. Multiplying by `x` is a shift to the *right*, and
//! what a shift pushes out has to come back at the *left*. Whole words are done at a time, by shifts
//! and XORs alone: no table, no multiplication, no step per bit or byte.
//!
//! **A word further.** Modulo `P`, `x^32 = x^16 + x^4 + x`, so a state of 32 bits is multiplied by `x^32`,
//! to make room for the next word, by three shifts to the right. What they push out are powers from
//! `x^32` on: the same equation applies to them. They are put in again at the left *before* the shifts,
//! which then carry them along, and since no shift is longer than half a word, nothing is pushed out
//! twice: `y = s ^ s<<16 ^ s<<28 ^ s<<31`, and `y>>16 ^ y>>4 ^ y>>1` is `s` times `x^32`.
//!
//! **Good or not.** Is a word a multiple of `P`? Dividing from the low powers up never ends, as with
//! `1 / (1 + u)` of numbers, except for multiples. With `P = 1 + u` and `(1 + u)(1 + u) = 1 + u^2`, the
//! quotient is the word times `(1 + u)(1 + u^2)(1 + u^4)`... until a power of `u` is beyond the word. Squaring
//! doubles exponents and adds nothing between, so each factor has at most three shifts. For a multiple
//! the quotient stops 16 places before the end: its last coefficients, 16 bits, are zero. The other way
//! round, a quotient that stops there times `P` has no room for anything beyond the word: it is the word.
//!
//! **Making a CRC** is the division from the high powers down, which does end: the quotient comes of the
//! same product in `1/x`, with `P = x^16 (1 + 1/x + x^-14 + x^-16)`, and the remainder is what is left.
//!
//! **Words of 64 bits.** The equation for `x^64` is dear, but `P = (x + 1)(x^15 + x + 1)`, and modulo
//! the second factor `x^64 = x^8 + x^4`. The first factor divides what has an even number of ones: XOR
//! all words, count once. A frame is good when both hold, because the factors have no common divisor. A
//! remainder modulo `x^15 + x + 1` comes by `x^15 = x + 1`, and squared `x^30 = x^2 + 1`, which lowers
//! all high powers at once; the parity then says which of the two 16-bit values that share it is the CRC.
//!
//! **Any length.** A message that does not fill its words gets zeros in front, which change nothing. The
//! initial value is added to its first two bytes, wherever these then are.
//!
//! The words are the machine's own: 64 bits on a host, 32 on a microcontroller, where a shift of 64
//! bits takes four instructions. Both forms are below, each complete.

#[cfg(any(feature = "ikeya", feature = "ucp"))]
use crate::error::ParseError;

/// Is `frame`, a whole frame with its CRC in the last two bytes, undamaged?
///
/// Anything shorter than its own CRC is not: fewer than two bytes are `false`.
///
/// ```
/// use axlewire::crc16;
/// assert!(crc16::check(&[0xAA, 0x01, 0xBE, 0xD0])); // READ for node 1
/// assert!(!crc16::check(&[0xAA, 0x02, 0xBE, 0xD0]));
/// ```
#[inline]
#[must_use]
pub const fn check(frame: &[u8]) -> bool {
    machine::check(frame)
}

/// [`check`] of a packet whose length is known when it is compiled.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn check_packet<const LEN: usize>(packet: &[u8; LEN]) -> bool {
    machine::check_packet(packet)
}

/// The CRC of `bytes`, to be sent low byte first behind them.
///
/// ```
/// use axlewire::crc16;
/// assert_eq!(crc16::compute(b"123456789"), 0x4B37);
/// assert_eq!(crc16::compute(&[0xAA, 0x01]).to_le_bytes(), [0xBE, 0xD0]);
/// ```
#[inline]
#[must_use]
pub const fn compute(bytes: &[u8]) -> u16 {
    machine::compute(bytes)
}

/// Zero for a good frame of 4 bytes, a word. Without branches: can be done in lanes.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn flaws_of_4(word: u32) -> u32 {
    narrow::flaws(word ^ 0xFFFF)
}

/// Zero for a good frame of 8 bytes, two words.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn flaws_of_8(first: u32, second: u32) -> u32 {
    narrow::flaws(narrow::times_x32(first ^ 0xFFFF) ^ second)
}

/// [`check`] with an answer that says what was wrong.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub(crate) fn verify(frame: &[u8]) -> Result<(), ParseError> {
    if check(frame) {
        return Ok(());
    }
    let Some((body, found)) = frame.split_last_chunk::<2>() else {
        return Err(ParseError::Length { expected: 2, found: frame.len() });
    };
    Err(ParseError::Crc { expected: compute(body), found: u16::from_le_bytes(*found) })
}

/// The CRC that belongs into the last two bytes of `frame`, whatever stands there now.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub(crate) fn seal(frame: &[u8]) -> [u8; 2] {
    let body = frame.split_last_chunk::<2>().map_or(&[][..], |(body, _)| body);
    compute(body).to_le_bytes()
}

/// `x^15 + x + 1`, a factor of the polynomial.
#[cfg(any(test, target_pointer_width = "64", feature = "ikeya"))]
pub(crate) const TRINOMIAL: u16 = 0xC001;

#[cfg(not(target_pointer_width = "64"))]
use narrow as machine;
#[cfg(target_pointer_width = "64")]
use wide as machine;

/// In words of 64 bits.
#[cfg(any(test, target_pointer_width = "64"))]
mod wide {
    use super::TRINOMIAL;

    #[inline(always)]
    pub(super) const fn check(frame: &[u8]) -> bool {
        // The packets of the bus are one word, or half of one with zeros behind it, which change nothing.
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
        // What most packets of the bus have in front of their CRC.
        if let (6, Some(low), Some(high)) = (bytes.len(), bytes.first_chunk(), bytes.last_chunk()) {
            return compute_6(u32::from_le_bytes(*low), u32::from_le_bytes(*high));
        }
        compute_any(bytes)
    }

    #[inline(never)]
    const fn compute_any(bytes: &[u8]) -> u16 {
        let Some(last) = bytes.last_chunk::<8>() else { return compute_short(bytes) };
        // The last word has two zero bytes at its end, which multiply by x^16.
        let word = u64::from_le_bytes(*last) >> 16;
        let (state, parity) = residue(bytes, 2);
        crc_of(word ^ times_x64(state), word ^ parity)
    }

    /// The message with `zeros` zero bytes behind it, without those words that have some: modulo the
    /// trinomial, not reduced, and the XOR of its words.
    #[inline(always)]
    const fn residue(bytes: &[u8], zeros: usize) -> (u64, u64) {
        let Some(first) = bytes.first_chunk::<8>() else { return residue_short(bytes) };
        // Zeros in front change nothing: as many as leave whole words behind.
        let head = (bytes.len() + zeros - 1) % 8 + 1;
        let mut state = (u64::from_le_bytes(*first) ^ 0xFFFF) << (64 - 8 * head);
        let mut parity = state;
        if head == 1 {
            // Half of the initial value belongs to the second byte, which is in the next word.
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

    /// The same of less than a word.
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

    /// Six bytes, in words of 32 bits. The product of this and x^16 needs no room at the left.
    #[inline(always)]
    const fn compute_6(first: u32, last: u32) -> u16 {
        let (low, high) = (first ^ 0xFFFF, last & 0xFFFF_0000);
        let state = fold_32(low);
        let product = state >> 4 ^ state >> 2 ^ high >> 2 ^ high >> 1;
        let remainder = fold_32(product);
        let odd = (low ^ high ^ remainder).count_ones() & 1 == 1;
        (remainder >> 16) as u16 ^ if odd { TRINOMIAL } else { 0 }
    }

    /// The CRC is the remainder of the message times x^16.
    #[inline(always)]
    const fn crc_of(product: u64, parity: u64) -> u16 {
        let remainder = reduce(fold(product));
        with_parity((remainder >> 48) as u16, parity ^ remainder)
    }

    /// Modulo the trinomial `remainder` stands for itself and for its sum with the trinomial.
    #[inline(always)]
    const fn with_parity(remainder: u16, parity: u64) -> u16 {
        remainder ^ if is_odd(parity) { TRINOMIAL } else { 0 }
    }

    /// The state before the first byte: `0xFFFF · x^-16` modulo the trinomial. Multiplied up to the
    /// first two bytes of a message of any length it is the initial value 0xFFFF.
    const INITIAL: u64 = 0xD556_0000_0000_0000;

    /// What the initial value adds behind one byte, of which its first half has been added.
    const LATE: u64 = INITIAL >> 8 ^ 0xFF << 56;

    /// Is the word a multiple of the whole polynomial?
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

    /// `x^64 = x^8 + x^4`, of any state.
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

    /// The full reduction of a folded word, by `x^15 = x + 1` twice: 15 bits at the end remain.
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

    /// Is the number of ones odd?
    #[inline(always)]
    const fn is_odd(word: u64) -> bool {
        word.count_ones() & 1 == 1
    }
}

/// In words of 32 bits.
#[cfg_attr(target_pointer_width = "64", allow(dead_code, reason = "a host does lanes with it"))]
mod narrow {
    #[inline(always)]
    pub(super) const fn check(frame: &[u8]) -> bool {
        frame.len() >= 2 && flaws(residue(frame)) == 0
    }

    /// One word or two without a loop.
    #[cfg(feature = "ikeya")]
    #[inline(always)]
    pub(super) const fn check_packet<const LEN: usize>(packet: &[u8; LEN]) -> bool {
        let Some((first, rest)) = packet.split_first_chunk() else { return check(packet) };
        let first = u32::from_le_bytes(*first);
        match rest {
            [] => super::flaws_of_4(first) == 0,
            &[a, b, c, d] => super::flaws_of_8(first, u32::from_le_bytes([a, b, c, d])) == 0,
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
        // Zeros in front change nothing: as many as leave whole words behind one byte and the odd ones.
        let (whole, odd) = (rest.len() & !3, rest.len() % 4);
        let mut state = (u32::from_le_bytes(*first) ^ 0xFFFF) << (24 - 8 * odd);
        if odd == 0 {
            // Half of the initial value belongs to the second byte, which is in the next word.
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

    /// The same of less than a word.
    #[inline(never)]
    const fn residue_short(mut bytes: &[u8]) -> u32 {
        let mut state = INITIAL;
        while let [byte, rest @ ..] = bytes {
            state = (*byte as u32) << 24 ^ times_x8(state);
            bytes = rest;
        }
        state
    }

    /// The state before the first byte: `0xFFFF · x^-16`. Multiplied up to the first two bytes of a message
    /// of any length it is the initial value 0xFFFF.
    const INITIAL: u32 = 0x1557_0000;

    /// What the initial value adds behind one byte, of which its first half has been added.
    const LATE: u32 = times_x8(INITIAL) ^ 0xFF << 24;

    /// `x^32 = x^16 + x^4 + x`.
    #[inline(always)]
    pub(super) const fn times_x32(state: u32) -> u32 {
        let state = state ^ state << 16 ^ state << 28 ^ state << 31;
        state >> 16 ^ state >> 4 ^ state >> 1
    }

    /// What is pushed out is again a multiple of `x^32`.
    #[inline(always)]
    const fn times_x16(state: u32) -> u32 {
        state >> 16 ^ times_x32(state << 16)
    }

    #[inline(always)]
    const fn times_x8(state: u32) -> u32 {
        state >> 8 ^ times_x32(state << 24)
    }

    /// Zero for a multiple of the polynomial: what must not be there at the end of the quotient.
    #[inline(always)]
    pub(super) const fn flaws(word: u32) -> u32 {
        let mut quotient = word;
        quotient ^= quotient >> 2 ^ quotient >> 15 ^ quotient >> 16;
        quotient ^= quotient >> 4 ^ quotient >> 30;
        quotient ^= quotient >> 8;
        quotient ^= quotient >> 16;
        quotient << 16
    }

    /// What the polynomial leaves of the word: all that its multiple, the quotient, does not cover.
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
}

/// The form that this machine does not use is tested on it, too: the tests in `tests` see only one.
#[cfg(test)]
mod tests {
    extern crate alloc;

    use super::{TRINOMIAL, narrow, wide};
    use alloc::vec;
    use crc::{CRC_16_MODBUS, Crc, Table};
    use proptest::prelude::*;

    const ORACLE: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

    fn assert_equal_to_oracle(message: &[u8]) {
        let crc = ORACLE.checksum(message);
        assert_eq!(wide::compute(message), crc, "{message:02x?}");
        assert_eq!(narrow::compute(message), crc, "{message:02x?}");
        // The good frame, the one that differs by `x^15 + x + 1`, and a damaged one.
        for (end, is_good) in [(crc, true), (crc ^ TRINOMIAL, false), (crc ^ 0x0100, false)] {
            let mut frame = message.to_vec();
            frame.extend(end.to_le_bytes());
            assert_eq!(wide::check(&frame), is_good, "{frame:02x?}");
            assert_eq!(narrow::check(&frame), is_good, "{frame:02x?}");
        }
    }

    #[test]
    fn every_one_hot_message_up_to_70_bytes_agrees_in_both_forms() {
        for len in 0..=70 {
            let mut message = vec![0; len];
            assert_equal_to_oracle(&message);
            for at in 0..len {
                for bit in 0..8 {
                    message[at] = 1 << bit;
                    assert_equal_to_oracle(&message);
                }
                message[at] = 0;
            }
        }
    }

    #[cfg(feature = "ikeya")]
    #[test]
    fn a_packet_whose_length_is_known_is_judged_as_any_other() {
        fn assert_alike<const LEN: usize>() {
            let mut packet = [0xA5; LEN];
            for _ in 0..2 {
                let (body, crc) = packet.split_last_chunk_mut::<2>().unwrap();
                *crc = ORACLE.checksum(body).to_le_bytes();
                assert!(narrow::check_packet(&packet) && wide::check_packet(&packet));
                for bit in 0..8 * LEN {
                    packet[bit / 8] ^= 1 << (bit % 8);
                    assert!(!narrow::check_packet(&packet) && !wide::check_packet(&packet));
                    packet[bit / 8] ^= 1 << (bit % 8);
                }
                packet.reverse();
            }
        }
        assert_alike::<4>();
        assert_alike::<7>();
        assert_alike::<8>();
        assert_alike::<9>();
    }

    #[test]
    fn both_forms_can_be_computed_at_compile_time() {
        const WIDE: u16 = wide::compute(b"123456789");
        const NARROW: u16 = narrow::compute(b"123456789");
        assert_eq!((WIDE, NARROW), (0x4B37, 0x4B37));
    }

    #[test]
    fn less_than_a_crc_is_good_in_no_form() {
        assert!(!wide::check(&[]) && !narrow::check(&[]));
        for byte in 0..=u8::MAX {
            assert!(!wide::check(&[byte]) && !narrow::check(&[byte]));
        }
    }

    proptest! {
        #[test]
        fn any_message_agrees_in_both_forms(message in prop::collection::vec(any::<u8>(), 0..400)) {
            assert_equal_to_oracle(&message);
        }

        #[test]
        fn both_forms_judge_any_bytes_alike(bytes in prop::collection::vec(any::<u8>(), 2..64)) {
            let (body, crc) = bytes.split_at(bytes.len() - 2);
            let is_good = ORACLE.checksum(body).to_le_bytes() == crc;
            prop_assert_eq!((wide::check(&bytes), narrow::check(&bytes)), (is_good, is_good));
        }
    }
}
