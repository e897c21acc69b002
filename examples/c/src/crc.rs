//! The checksum.

use crate::memory::bytes;

/// CRC-16/MODBUS of the bytes (ruling B1): what both protocols put behind them, low byte first.
///
/// 0xFFFF, the CRC of no bytes, if `data` is null.
#[unsafe(no_mangle)]
pub extern "C" fn axle_crc16(data: *const u8, length: usize) -> u16 {
    axlewire::crc16::compute(bytes(data, length).unwrap_or(&[]))
}
