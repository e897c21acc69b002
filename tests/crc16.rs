//! The checksum against the `crc` crate, and the errors it is required to detect (ruling B1).

use axlewire::crc16::{check, compute};
use crc::{CRC_16_MODBUS, Crc, Table};
use proptest::prelude::*;

const ORACLE: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

/// A small generator of fixed byte streams, for data whose content does not matter.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| (self.next() >> 32) as u8).collect()
    }
}

fn assert_equal_to_oracle(message: &[u8]) {
    let crc = ORACLE.checksum(message);
    assert_eq!(compute(message), crc, "{message:02x?}");
    let mut frame = message.to_vec();
    frame.extend(crc.to_le_bytes());
    assert!(check(&frame), "{frame:02x?}");
}

#[test]
fn the_catalogued_check_value_matches() {
    assert_eq!(compute(b"123456789"), 0x4B37);
    assert_eq!(CRC_16_MODBUS.check, 0x4B37);
    assert_eq!(compute(b""), 0xFFFF);
}

#[test]
fn it_can_be_computed_at_compile_time() {
    const CRC: u16 = compute(b"123456789");
    const GOOD: bool = check(&[0xAA, 0x01, 0xBE, 0xD0]);
    assert_eq!((CRC, GOOD), (0x4B37, true));
}

#[test]
fn every_length_up_to_300_agrees_on_random_data() {
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    for len in 0..=300 {
        for _ in 0..20 {
            assert_equal_to_oracle(&random.bytes(len));
        }
    }
}

#[test]
fn every_single_byte_message_agrees() {
    for byte in 0..=u8::MAX {
        assert_equal_to_oracle(&[byte]);
    }
}

#[test]
fn every_one_hot_message_up_to_300_bytes_agrees() {
    for len in 1..=300 {
        let mut message = vec![0; len];
        for at in 0..len {
            for bit in 0..8 {
                message[at] = 1 << bit;
                assert_eq!(
                    compute(&message),
                    ORACLE.checksum(&message),
                    "bit {bit} of {at} of {len}"
                );
            }
            message[at] = 0;
        }
    }
}

#[test]
fn fewer_bytes_than_a_crc_are_never_good() {
    assert!(!check(&[]));
    for byte in 0..=u8::MAX {
        assert!(!check(&[byte]));
    }
    let good: Vec<u16> = (0..=u16::MAX).filter(|crc| check(&crc.to_le_bytes())).collect();
    assert_eq!(good, [0xFFFF], "two bytes are good only if they are the CRC of an empty message");
}

proptest! {
    #[test]
    fn any_message_agrees(message in prop::collection::vec(any::<u8>(), 0..1000)) {
        assert_equal_to_oracle(&message);
    }

    #[test]
    fn any_bytes_are_judged_like_the_oracle(bytes in prop::collection::vec(any::<u8>(), 2..64)) {
        let (body, crc) = bytes.split_at(bytes.len() - 2);
        prop_assert_eq!(check(&bytes), ORACLE.checksum(body).to_le_bytes() == crc);
    }
}

/// Every possible frame length of either protocol, up to the longest known, in bytes.
fn legal_lengths() -> impl Iterator<Item = usize> {
    [4].into_iter().chain(8..=44)
}

fn good_frame(len: usize) -> Vec<u8> {
    let mut frame = Random(len as u64 + 1).bytes(len - 2);
    frame.extend(compute(&frame).to_le_bytes());
    frame
}

fn flip(frame: &mut [u8], bit: usize) {
    frame[bit / 8] ^= 1 << (bit % 8);
}

#[test]
fn every_error_of_one_or_two_bits_is_detected() {
    for len in legal_lengths() {
        let mut frame = good_frame(len);
        for first in 0..8 * len {
            flip(&mut frame, first);
            assert!(!check(&frame), "bit {first} of {len} bytes");
            for second in first + 1..8 * len {
                flip(&mut frame, second);
                assert!(!check(&frame), "bits {first}, {second} of {len} bytes");
                flip(&mut frame, second);
            }
            flip(&mut frame, first);
        }
        assert!(check(&frame));
    }
}

#[test]
fn every_error_of_three_bits_is_detected_up_to_24_bytes() {
    for len in legal_lengths().filter(|&len| len <= 24) {
        let mut frame = good_frame(len);
        for first in 0..8 * len {
            flip(&mut frame, first);
            for second in first + 1..8 * len {
                flip(&mut frame, second);
                for third in second + 1..8 * len {
                    flip(&mut frame, third);
                    assert!(!check(&frame), "bits {first}, {second}, {third} of {len} bytes");
                    flip(&mut frame, third);
                }
                flip(&mut frame, second);
            }
            flip(&mut frame, first);
        }
    }
}

#[test]
fn sampled_errors_of_three_bits_are_detected_up_to_44_bytes() {
    let mut random = Random(0xD1B5_4A32_D192_ED03);
    for len in legal_lengths().filter(|&len| len > 24) {
        let mut frame = good_frame(len);
        let mut distinct = 0;
        while distinct < 20_000 {
            let bits = [(); 3].map(|()| random.next() as usize % (8 * len));
            if bits[0] == bits[1] || bits[0] == bits[2] || bits[1] == bits[2] {
                continue;
            }
            distinct += 1;
            bits.iter().for_each(|&bit| flip(&mut frame, bit));
            assert!(!check(&frame), "bits {bits:?} of {len} bytes");
            bits.iter().for_each(|&bit| flip(&mut frame, bit));
        }
    }
}
