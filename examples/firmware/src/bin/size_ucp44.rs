//! The decoder of UCP frames from a slice.

#![no_std]
#![no_main]

axlewire_firmware::size_program!(axlewire_firmware::work::ucp_slice);
