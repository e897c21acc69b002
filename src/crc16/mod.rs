//! CRC-16/MODBUS without a table (ruling B1).
//!
//! Both protocols end every frame with this checksum, low byte first. Polynomial 0x8005, least
//! significant bit first (0xA001 reflected); initial value 0xFFFF; no final XOR. The check value of
//! the CRC catalogue, the CRC of `123456789`, is 0x4B37.
//!
//! # How it works
//!
//! A message is a polynomial over the field of two elements. The first bit sent is the coefficient
//! of the highest power, and a frame is good when `P = x^16 + x^15 + x^2 + 1` divides it. Words are
//! read little-endian, so bit 0 of a word was sent first: multiplying by `x` is a shift to the
//! *right*, and the bits shifted out re-enter at the *left*. The code works on whole words, with
//! shifts and XORs alone: no table, no multiplication, no step per bit or byte.
//!
//! **Appending a word.** The 32-bit state `s` is multiplied by `x^32` to make room for the next
//! word, which is then XORed in. Modulo `P`, `x^32 = x^16 + x^4 + x`, so three shifts to the right
//! do it. The bits they shift out are powers from `x^32` on, so the same equation applies to them.
//! They are put back in at the left *before* the shifts, which then carry them along: with
//! `y = s ^ s<<16 ^ s<<28 ^ s<<31`, `y>>16 ^ y>>4 ^ y>>1` is `s` times `x^32`. No shift is longer
//! than half a word, so no bit is shifted out twice.
//!
//! **Checking a frame.** The whole frame is now one word. Is it a multiple of `P`? Divide it from
//! the low powers up. Like `1 / (1 + u)` for numbers, this gives an infinite series, except for
//! multiples. Write `P = 1 + u`. As `(1 + u)(1 + u) = 1 + u^2`, the quotient is the word times
//! `(1 + u)(1 + u^2)(1 + u^4)`... until a power of `u` is beyond the word. Squaring doubles the
//! exponents and adds no cross terms, so each factor takes at most three shifts. For a multiple,
//! the quotient ends 16 places before the word does: its last 16 coefficients are zero. Conversely,
//! a quotient that ends there, times `P`, fits into the word, and so it is the word.
//!
//! **Computing a CRC.** The CRC is the remainder of the message times `x^16`. Division from the
//! high powers down does end. The quotient is the same product in `1/x`, with
//! `P = x^16 (1 + 1/x + x^-14 + x^-16)`, and the remainder is what is left.
//!
//! **64-bit words.** Reducing by `x^64` directly is expensive, but `P = (x + 1)(x^15 + x + 1)`, and
//! modulo the second factor `x^64 = x^8 + x^4`. The first factor divides exactly the polynomials
//! with an even number of ones: XOR all words, and count the ones once. The factors have no common
//! divisor, so a frame is good when both divide it. To reduce modulo `x^15 + x + 1`, use
//! `x^15 = x + 1` and its square, `x^30 = x^2 + 1`, which lowers all high powers at once. Two
//! 16-bit values share that remainder, and the parity tells which of them is the CRC.
//!
//! **Any length.** A message that does not fill its words is padded with zeros in front, which
//! change nothing. The initial value is XORed into its first two bytes, wherever they end up.
//!
//! The word is the machine's own: 64 bits (`wide`) on a host, 32 (`narrow`) on a microcontroller,
//! where a 64-bit shift takes four instructions.

mod narrow;
#[cfg(any(test, target_pointer_width = "64"))]
mod wide;

#[cfg(not(target_pointer_width = "64"))]
use narrow as words;
#[cfg(target_pointer_width = "64")]
use wide as words;

#[cfg(feature = "ikeya")]
pub(crate) use narrow::{TRINOMIAL, syndrome_8};

#[cfg(any(feature = "ikeya", feature = "ucp"))]
use crate::error::ParseError;

/// Whether `frame`, a whole frame with its CRC in the last two bytes, is undamaged.
///
/// `false` for fewer than two bytes, which cannot hold a CRC.
///
/// ```
/// use axlewire::crc16;
/// assert!(crc16::check(&[0xAA, 0x01, 0xBE, 0xD0])); // READ for node 1
/// assert!(!crc16::check(&[0xAA, 0x02, 0xBE, 0xD0]));
/// ```
#[inline]
#[must_use]
pub const fn check(frame: &[u8]) -> bool {
    words::check(frame)
}

/// [`check`] for a packet whose length is known at compile time.
#[cfg(feature = "ikeya")]
#[inline(always)]
pub(crate) const fn check_packet<const LEN: usize>(packet: &[u8; LEN]) -> bool {
    words::check_packet(packet)
}

/// The CRC of `bytes`. Send it after them, low byte first.
///
/// ```
/// use axlewire::crc16;
/// assert_eq!(crc16::compute(b"123456789"), 0x4B37);
/// assert_eq!(crc16::compute(&[0xAA, 0x01]).to_le_bytes(), [0xBE, 0xD0]);
/// ```
#[inline]
#[must_use]
pub const fn compute(bytes: &[u8]) -> u16 {
    words::compute(bytes)
}

/// [`check`] that returns the reason for a failure.
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

/// The CRC for the last two bytes of `frame`, whatever they contain now.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub(crate) fn seal(frame: &[u8]) -> [u8; 2] {
    let body = frame.split_last_chunk::<2>().map_or(&[][..], |(body, _)| body);
    compute(body).to_le_bytes()
}

/// Both forms are tested here, on every machine; the tests in `tests` see only one of them.
#[cfg(test)]
mod tests {
    extern crate alloc;

    use super::{
        narrow::{self, TRINOMIAL},
        wide,
    };
    use alloc::vec;
    use crc::{CRC_16_MODBUS, Crc, Table};
    use proptest::prelude::*;

    const ORACLE: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

    fn assert_equal_to_oracle(message: &[u8]) {
        let crc = ORACLE.checksum(message);
        assert_eq!(wide::compute(message), crc, "{message:02x?}");
        assert_eq!(narrow::compute(message), crc, "{message:02x?}");
        // The good frame, one that differs by `x^15 + x + 1`, and a damaged one.
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
