//! CRC-16/MODBUS without a table (ruling B1).
//!
//! Both protocols end every frame with this checksum, low byte first: polynomial 0x8005 sent
//! least significant bit first (0xA001 reflected), initial value 0xFFFF, no final XOR. The
//! catalogue's check value, the CRC of `123456789`, is 0x4B37.
//!
//! # How it works
//!
//! The polynomial is a product, `x^16 + x^15 + x^2 + 1 = (x + 1)(x^15 + x + 1)`, and its factors have
//! no common divisor, so a frame is good exactly when both divide it:
//!
//! * `x + 1` divides it when it has an even number of ones, because the remainder is its value at
//!   `x = 1`: XOR all words, count bits once.
//! * `x^15 + x + 1` has only three terms: `x^15` may be replaced by `x + 1`. Squaring doubles every
//!   exponent and adds nothing between, as `2ab = 0`; hence `x^30 = x^2 + 1`, and in general
//!   `x^(15·2^k) = x^(2^k) + 1`. One replacement lowers all high powers of a word at the same time: a
//!   shift for each of the two terms and an XOR, instead of a step per bit or a table look-up per byte.
//!
//! To *make* a CRC, the remainder modulo `x^15 + x + 1` is not enough: two 16-bit values share it, and
//! they differ by `x^15 + x + 1` itself. That has three ones, so one of the two has even parity and the
//! other odd, and the parity of the message says which one is right.
//!
//! The words are the machine's own: 64 bits on a host, 32 bits on a microcontroller, where a shift of
//! 64 bits would take four instructions. Both forms are below, each complete: a state is multiplied up
//! by the length of the next word, the word is added, and the sum is folded, which makes room for the
//! next multiplication. At the end the state is reduced to the remainder's 15 bits.
//!
//! Words are read little-endian, so bit 0 of a word is the bit that was sent first and belongs to
//! the highest power; multiplying by `x` is a shift to the *right*, and a bit that is reduced
//! reappears further to the *left*.

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

/// `x^15 + x + 1` as a reflected 16-bit value.
const TRINOMIAL: u16 = 0xC001;

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
        let (state, parity) = residue(frame);
        frame.len() >= 2 && parity.count_ones() & 1 == 0 && reduce(state) == 0
    }

    #[inline(always)]
    pub(super) const fn compute(bytes: &[u8]) -> u16 {
        match bytes {
            // Six bytes are what most packets of the bus have before their CRC: one word, with the
            // two zero bytes behind them that multiply by x^16.
            &[a, b, c, d, e, f] => {
                let (low, high) = (u32::from_le_bytes([a, b, c, d]), u16::from_le_bytes([e, f]));
                let word = (low ^ 0xFFFF) as u64 | (high as u64) << 32;
                crc_of(word, word)
            }
            _ => compute_any(bytes),
        }
    }

    #[inline(never)]
    const fn compute_any(bytes: &[u8]) -> u16 {
        let (state, parity) = residue(bytes);
        crc_of(times_x16(state), parity)
    }

    /// The CRC is the remainder of the message times x^16. Its 15 bits modulo x^15 + x + 1 name two
    /// 16-bit values; the parity of the message says which one.
    #[inline(always)]
    const fn crc_of(product: u64, parity: u64) -> u16 {
        let remainder = reduce(fold(product));
        let is_odd = (parity ^ remainder).count_ones() & 1 == 1;
        (remainder >> 48) as u16 ^ if is_odd { TRINOMIAL } else { 0 }
    }

    /// The state before the first byte: `0xFFFF · x^-16` modulo the trinomial. Multiplied up to the
    /// first two bytes of a message of any length it is the initial value 0xFFFF.
    const INITIAL: u64 = 0xD556_0000_0000_0000;

    /// The message modulo the trinomial, folded but not fully reduced, and the XOR of its words.
    #[inline(always)]
    const fn residue(mut bytes: &[u8]) -> (u64, u64) {
        let mut state = INITIAL;
        let mut parity = 0;
        while let Some((&[a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p], rest)) =
            bytes.split_first_chunk::<16>()
        {
            let first = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
            let second = u64::from_le_bytes([i, j, k, l, m, n, o, p]);
            parity ^= first ^ second;
            state = fold(first ^ times_x64(state));
            state = fold(second ^ times_x64(state));
            bytes = rest;
        }
        if let Some((word, rest)) = bytes.split_first_chunk::<8>() {
            let word = u64::from_le_bytes(*word);
            parity ^= word;
            state = fold(word ^ times_x64(state));
            bytes = rest;
        }
        if let Some((word, rest)) = bytes.split_first_chunk::<4>() {
            let word = (u32::from_le_bytes(*word) as u64) << 32;
            parity ^= word;
            state = fold(word ^ times_x32(state));
            bytes = rest;
        }
        if let Some((word, rest)) = bytes.split_first_chunk::<2>() {
            let word = (u16::from_le_bytes(*word) as u64) << 48;
            parity ^= word;
            state = fold(word ^ times_x16(state));
            bytes = rest;
        }
        if let [byte, ..] = bytes {
            let word = (*byte as u64) << 56;
            parity ^= word;
            state = fold(word ^ times_x8(state));
        }
        (state, parity)
    }

    /// One reduction by `x^30 = x^2 + 1`: the first 28 bits become zero.
    #[inline(always)]
    const fn fold(word: u64) -> u64 {
        let moved = word << 30;
        (word & !((1 << 34) - 1)) ^ moved ^ (moved >> 2)
    }

    /// The full reduction of a folded word, by `x^15 = x + 1` twice: 15 bits at the end remain.
    #[inline(always)]
    const fn reduce(mut state: u64) -> u64 {
        let mut step = 0;
        while step < 2 {
            let moved = state << 15;
            state = (state & !((1 << 49) - 1)) ^ moved ^ (moved >> 1);
            step += 1;
        }
        state
    }

    // Multiplications of a folded state. Its first 28 bits are zero, so nothing is shifted out.

    /// `x^64 = x^8 + x^4`.
    #[inline(always)]
    const fn times_x64(state: u64) -> u64 {
        (state >> 8) ^ (state >> 4)
    }

    /// `x^32 = x^4 + x^2`.
    #[inline(always)]
    const fn times_x32(state: u64) -> u64 {
        (state >> 4) ^ (state >> 2)
    }

    /// `x^16 = x^2 + x`.
    #[inline(always)]
    const fn times_x16(state: u64) -> u64 {
        (state >> 2) ^ (state >> 1)
    }

    /// `x^8`, which is small enough as it is.
    #[inline(always)]
    const fn times_x8(state: u64) -> u64 {
        state >> 8
    }
}

/// In words of 32 bits.
#[cfg(any(test, not(target_pointer_width = "64")))]
mod narrow {
    use super::TRINOMIAL;

    #[inline(always)]
    pub(super) const fn check(frame: &[u8]) -> bool {
        let (state, parity) = residue(frame);
        frame.len() >= 2 && fold(state) == 0 && !is_odd(parity)
    }

    #[inline(always)]
    pub(super) const fn compute(bytes: &[u8]) -> u16 {
        let (state, parity) = residue(bytes);
        // As above: the 15 bits of the remainder, and the parity for the 16th.
        let remainder = fold(fold(times_x16(state)));
        let crc = (remainder >> 16) as u16;
        if is_odd(parity ^ remainder) { crc ^ TRINOMIAL } else { crc }
    }

    /// The state before the first byte, as in the wide form.
    const INITIAL: u32 = 0xD556_0000;

    /// The message modulo the trinomial, folded but not fully reduced, and the XOR of its words.
    #[inline(always)]
    const fn residue(mut bytes: &[u8]) -> (u32, u32) {
        let mut state = INITIAL;
        let mut parity = 0;
        while let Some((word, rest)) = bytes.split_first_chunk::<4>() {
            let word = u32::from_le_bytes(*word);
            parity ^= word;
            state = fold(word ^ times_x32(state));
            bytes = rest;
        }
        while let [byte, rest @ ..] = bytes {
            let word = (*byte as u32) << 24;
            parity ^= word;
            state = fold(word ^ times_x8(state));
            bytes = rest;
        }
        (state, parity)
    }

    /// One reduction by `x^15 = x + 1`: the first 14 bits become zero. Twice, and 15 bits at the end
    /// remain.
    #[inline(always)]
    const fn fold(word: u32) -> u32 {
        let moved = word << 15;
        (word & !0x1_FFFF) ^ moved ^ (moved >> 1)
    }

    // Multiplications of a folded state. Its first 14 bits are zero, so nothing is shifted out.

    /// `x^32 = x^4 + x^2`.
    #[inline(always)]
    const fn times_x32(state: u32) -> u32 {
        (state >> 4) ^ (state >> 2)
    }

    /// `x^16 = x^2 + x`.
    #[inline(always)]
    const fn times_x16(state: u32) -> u32 {
        (state >> 2) ^ (state >> 1)
    }

    /// `x^8`, which is small enough as it is.
    #[inline(always)]
    const fn times_x8(state: u32) -> u32 {
        state >> 8
    }

    /// Is the number of ones odd? These processors cannot count ones in one step.
    #[inline(always)]
    const fn is_odd(mut word: u32) -> bool {
        word ^= word >> 16;
        word ^= word >> 8;
        word ^= word >> 4;
        word ^= word >> 2;
        word ^= word >> 1;
        word & 1 == 1
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
        // The good frame, the one that only the parity tells from it, and a damaged one.
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
