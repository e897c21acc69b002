//! The decoder of 8-byte answers from a slice.

#![no_std]
#![no_main]

axlewire_firmware::size_program!(axlewire_firmware::work::ikeya_slice);
