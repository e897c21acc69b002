//! The checksum against the `crc` crate (ruling B1). The errors that it detects are in
//! `tests/exhaustive`.

use axlewire::crc16::{check, compute};
use crc::{CRC_16_MODBUS, Crc, Table};
use proptest::prelude::*;

use crate::dice::Dice;

const ORACLE: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);

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
    let mut dice = Dice(1);
    for len in 0..=300 {
        for _ in 0..20 {
            assert_equal_to_oracle(&dice.bytes(len));
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
