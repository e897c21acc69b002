// The library's own source, both forms on every machine: from outside only one of them is seen.
#![allow(dead_code, unreachable_pub, reason = "the library uses all of it")]

#[path = "../../src/crc16/narrow.rs"]
mod narrow;
#[path = "../../src/crc16/wide.rs"]
mod wide;

use super::*;

/// Room for a frame of 302 bytes at any place in 16 bytes.
#[repr(align(16))]
struct Room([u8; 320]);

/// Puts a message at all 16 alignments and compares both forms, and the public one, with the
/// oracle: its CRC, whether it is a frame with that CRC, and that it is none with another.
fn assert_equal_to_oracle(message: &[u8], room: &mut Room) {
    let crc = oracle::crc(message);
    let [low, high] = crc.to_le_bytes();
    let len = message.len();
    for at in 0..16 {
        let frame = &mut room.0[at..at + len + 2];
        frame[..len].copy_from_slice(message);
        frame[len..].copy_from_slice(&[low, high]);
        let body = &frame[..len];
        let found = [wide::compute(body), narrow::compute(body), crc16::compute(body)];
        assert_eq!(found, [crc; 3], "{len} bytes at {at}: {message:02x?}");
        let good = [wide::check(frame), narrow::check(frame), crc16::check(frame)];
        assert_eq!(good, [true; 3], "{len} bytes at {at}: {message:02x?}");
        // A bit in each byte of the CRC, and what only the parity tells apart: x^15 + x + 1.
        let end = frame.len();
        for wrong in [0x0001, 0x8000, narrow::TRINOMIAL] {
            frame[end - 2..].copy_from_slice(&(crc ^ wrong).to_le_bytes());
            let bad = [wide::check(frame), narrow::check(frame), crc16::check(frame)];
            assert_eq!(bad, [false; 3], "{len} bytes at {at}: {message:02x?} ^ {wrong:x}");
        }
    }
}

/// The messages of a length: zeros, ones, every single bit, and random ones. Returns how many.
fn check_length(len: usize, random: usize) -> usize {
    let (mut room, mut dice) = (Room([0x5A; 320]), Dice(len as u64));
    assert_equal_to_oracle(&vec![0xFF; len], &mut room);
    let mut message = vec![0; len];
    assert_equal_to_oracle(&message, &mut room);
    for bit in 0..8 * len {
        message[bit / 8] = 1 << (bit % 8);
        assert_equal_to_oracle(&message, &mut room);
        message[bit / 8] = 0;
    }
    for _ in 0..random {
        dice.fill(&mut message);
        assert_equal_to_oracle(&message, &mut room);
    }
    2 + 8 * len + random
}

#[test]
fn both_forms_equal_the_oracle_up_to_26_bytes_and_on_some_longer_ones() {
    (0..=26).for_each(|len| assert!(check_length(len, 4) > len));
    let (mut room, mut dice) = (Room([0; 320]), Dice(1));
    (27..=300).for_each(|len| assert_equal_to_oracle(&dice.bytes(len), &mut room));
}

#[test]
#[ignore = "takes a minute: see the top of main.rs"]
fn both_forms_equal_the_oracle_for_all_lengths_up_to_300_and_all_alignments() {
    let messages =
        |lens: Range<u64>| -> usize { lens.map(|len| check_length(len as usize, 2000)).sum() };
    let messages: usize = on_all_cores(301, messages).iter().sum();
    assert_eq!(messages, 301 * 2002 + 8 * (300 * 301 / 2));
    println!("{messages} messages of 0 to 300 bytes, at 16 alignments, in both forms");
}

/// What makes the messages with a single bit worth so much: the CRC of a sum is the sum of the
/// CRCs, so that they decide all others. A sample; that shifts and XORs add up is plain to see.
#[test]
fn the_crc_of_a_sum_is_the_sum_of_the_crcs() {
    let mut dice = Dice(2);
    for len in 0..=300 {
        let [a, b] = [dice.bytes(len), dice.bytes(len)];
        let sum: Vec<u8> = a.iter().zip(&b).map(|(a, b)| a ^ b).collect();
        for compute in [wide::compute as fn(&[u8]) -> u16, narrow::compute, oracle::crc] {
            let zeros = compute(&vec![0; len]);
            assert_eq!(compute(&a) ^ compute(&b) ^ zeros, compute(&sum), "{len} bytes");
        }
    }
}
