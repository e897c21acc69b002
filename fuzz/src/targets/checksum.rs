//! Both forms of the CRC against one that is computed bit by bit: 64-bit words, which a host uses,
//! and 32-bit words, for microcontrollers and for the lanes of a host. The latter is compiled in
//! from the library's own file, because no build for a host calls it.

#[path = "../../../src/crc16/narrow.rs"]
#[allow(dead_code, clippy::all, reason = "a part of the library, checked there")]
mod narrow;

use axlewire::crc16;

use super::{Tally, oracle};

/// Computes and checks the CRC of any bytes, at any alignment.
pub(super) fn crc16(data: &[u8], tally: &mut Tally) {
    let crc = oracle::crc(data);
    assert_eq!(crc16::compute(data), crc);
    assert_eq!(narrow::compute(data), crc);
    tally.did(0);

    for skipped in 1..data.len().min(9) {
        let rest = &data[skipped..];
        let crc = oracle::crc(rest);
        assert_eq!((crc16::compute(rest), narrow::compute(rest)), (crc, crc));
        tally.did(1);
    }

    let mut frame = [data, &crc.to_le_bytes()].concat();
    assert!(crc16::check(&frame) && narrow::check(&frame));
    // Two of these errors keep the remainder modulo one factor of the polynomial, and two the
    // parity.
    for other in [0xC001, 0x0003, 0xFFFF] {
        let [.., low, high] = &mut frame[..] else { return };
        [*low, *high] = (crc ^ other).to_le_bytes();
        assert!(!crc16::check(&frame) && !narrow::check(&frame));
        tally.did(2);
    }

    let is_good = data
        .split_last_chunk()
        .is_some_and(|(body, found)| oracle::crc(body) == u16::from_le_bytes(*found));
    assert_eq!((crc16::check(data), narrow::check(data)), (is_good, is_good));
    tally.did(3);
    packets(data, tally);
}

/// The syndromes of whole packets in one and in two words.
fn packets(data: &[u8], tally: &mut Tally) {
    let word = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    for packet in data.windows(8).step_by(8) {
        let mut packet = packet.to_vec();
        for is_sealed in [false, true] {
            if is_sealed {
                oracle::seal(&mut packet[..4]);
            }
            let (short, is_good) = (&packet[..4], is_good(&packet[..4]));
            assert_eq!(narrow::syndrome_4(word(short)) == 0, is_good, "{short:02x?}");
            assert!(is_good || !is_sealed);
            tally.did(4);
        }
        for is_sealed in [false, true] {
            if is_sealed {
                oracle::seal(&mut packet);
            }
            let syndrome = narrow::syndrome_8(word(&packet), word(&packet[4..]));
            assert_eq!(syndrome == 0, is_good(&packet), "{packet:02x?}");
            assert!(is_good(&packet) || !is_sealed);
            tally.did(5);
        }
    }
}

fn is_good(packet: &[u8]) -> bool {
    let (body, crc) = packet.split_at(packet.len() - 2);
    oracle::crc(body).to_le_bytes() == crc
}
