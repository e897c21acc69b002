//! The checksum over any length.

#![no_std]
#![no_main]

use axlewire::crc16;

axlewire_firmware::size_program!(crc_of);

fn crc_of(bytes: &[u8]) -> u32 {
    crc16::compute(bytes).into()
}
