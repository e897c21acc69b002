//! Safe wrappers of the C reference.
#![allow(unsafe_code)]

use crate::Tally;

mod ffi {
    use crate::Tally;

    // SAFETY: these are the declarations of reference/axle_ref.h; `Tally` is `axle_ref_tally`, two
    // `uint64_t` in the same order.
    unsafe extern "C" {
        pub(super) fn axle_ref_crc_table(bytes: *const u8, len: usize) -> u16;
        pub(super) fn axle_ref_crc_bitwise(bytes: *const u8, len: usize) -> u16;
        pub(super) fn axle_ref_ikeya_table(bytes: *const u8, len: usize) -> Tally;
        pub(super) fn axle_ref_ikeya_bitwise(bytes: *const u8, len: usize) -> Tally;
        pub(super) fn axle_ref_ucp_table(bytes: *const u8, len: usize) -> Tally;
        pub(super) fn axle_ref_ucp_bitwise(bytes: *const u8, len: usize) -> Tally;
    }
}

/// CRC-16/MODBUS with two tables of 256 bytes.
#[must_use]
pub fn crc_table(bytes: &[u8]) -> u16 {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_crc_table(bytes.as_ptr(), bytes.len()) }
}

/// CRC-16/MODBUS bit by bit.
#[must_use]
pub fn crc_bitwise(bytes: &[u8]) -> u16 {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_crc_bitwise(bytes.as_ptr(), bytes.len()) }
}

/// Ikeya receiver, byte by byte, with the two-table CRC.
#[must_use]
pub fn ikeya_table(bytes: &[u8]) -> Tally {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_ikeya_table(bytes.as_ptr(), bytes.len()) }
}

/// Ikeya receiver, byte by byte, with the bitwise CRC.
#[must_use]
pub fn ikeya_bitwise(bytes: &[u8]) -> Tally {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_ikeya_bitwise(bytes.as_ptr(), bytes.len()) }
}

/// UCP receiver, byte by byte, with the two-table CRC.
#[must_use]
pub fn ucp_table(bytes: &[u8]) -> Tally {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_ucp_table(bytes.as_ptr(), bytes.len()) }
}

/// UCP receiver, byte by byte, with the bitwise CRC.
#[must_use]
pub fn ucp_bitwise(bytes: &[u8]) -> Tally {
    // SAFETY: reads `bytes` and nothing else, and keeps no pointer.
    unsafe { ffi::axle_ref_ucp_bitwise(bytes.as_ptr(), bytes.len()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        IKEYA, Protocol, UCP,
        streams::{self, Rng},
    };

    #[test]
    fn the_crcs_of_c_and_of_axlewire_are_the_same() {
        assert_eq!(crc_table(b"123456789"), 0x4B37);
        let mut rng = Rng::new(1);
        for len in 0..300 {
            let bytes: Vec<u8> = (0..len).map(|_| rng.byte()).collect();
            let expected = axlewire::crc16::compute(&bytes);
            assert_eq!(crc_table(&bytes), expected, "table, {len} bytes");
            assert_eq!(crc_bitwise(&bytes), expected, "bitwise, {len} bytes");
        }
    }

    #[test]
    fn the_receivers_find_every_frame_of_a_clean_stream() {
        for stream in streams::clean(100_000) {
            let expected = (stream.protocol.oracle)(&stream.bytes);
            assert_eq!(expected.frames as usize, stream.intact.len(), "{}", stream.name);
            assert_eq!((stream.protocol.c_table)(&stream.bytes), expected, "{}", stream.name);
            assert_eq!((stream.protocol.c_bitwise)(&stream.bytes), expected, "{}", stream.name);
        }
    }

    #[test]
    fn the_receivers_lose_good_frames_behind_a_false_header() {
        let read = [0xAA, 0x01, 0xBE, 0xD0];
        let ping = [0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42];
        assert_eq!(ikeya_table(&[&read[..], &read].concat()).frames, 2);
        assert_eq!(ikeya_table(&[&[0xBB][..], &read, &read].concat()).frames, 0);
        assert_eq!(ucp_table(&[&ping[..], &ping].concat()).frames, 2);
        assert_eq!(ucp_table(&[&[0xFD][..], &ping, &ping].concat()).frames, 1);
    }

    #[test]
    fn the_receivers_keep_to_the_limits_of_axlewire() {
        let found = |protocol: Protocol, covered: &[u8]| {
            let frame = [covered, &crc_table(covered).to_le_bytes()].concat();
            let c = (protocol.c_table)(&frame).frames;
            assert_eq!(c, (protocol.frames)(&frame).frames);
            c
        };
        assert_eq!([0, 1, 8, 9].map(|id| found(IKEYA, &[0x55, id, 0, 0, 0, 0])), [0, 1, 1, 0]);
        let ucp = |len: u8| {
            let mut frame = vec![0xFD, 0xFF, len, 0];
            frame.resize(usize::from(len) + 2, 0);
            found(UCP, &frame)
        };
        assert_eq!([4, 60, 61].map(ucp), [1, 1, 0]);
    }
}
