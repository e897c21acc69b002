//! Finds packets of 8 bytes that directly follow each other, many at once.
//!
//! Works in lanes of 32 bits, like `crc16` on a microcontroller: one step handles as many lanes as
//! a register holds. The loop is a plain loop over an array, which the compiler vectorizes.

use zerocopy::{little_endian::U32, transmute_ref};

use crate::crc16;

/// Number of packets judged together; one bit in a mask for each.
const PACKETS: usize = 16;

/// Number of packets of 8 bytes with a valid CRC at the front. Their header and id are checked when
/// they are handed out.
#[inline(always)]
pub(crate) fn accept_batch(bytes: &[u8]) -> usize {
    let Some(bytes) = bytes.first_chunk::<{ 8 * PACKETS }>() else { return 0 };
    let packets: &[[U32; 2]; PACKETS] = transmute_ref!(bytes);
    let mut right = 0_u32;
    for (at, [first, second]) in packets.iter().enumerate() {
        let syndrome = crc16::syndrome_8(first.get(), second.get());
        right |= if syndrome == 0 { 1 << at } else { 0 };
    }
    right.trailing_ones() as usize
}
