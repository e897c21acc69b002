//! The empty program, the baseline for all others.

#![no_std]
#![no_main]

axlewire_firmware::size_program!(|bytes: &[u8]| bytes.len() as u32);
