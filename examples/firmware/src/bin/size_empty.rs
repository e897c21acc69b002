//! The program that all others are compared with.

#![no_std]
#![no_main]

axlewire_firmware::size_program!(|bytes: &[u8]| bytes.len() as u32);
