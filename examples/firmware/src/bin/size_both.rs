//! Both decoders from a slice.

#![no_std]
#![no_main]

use axlewire_firmware::work::{ikeya_slice, ucp_slice};

axlewire_firmware::size_program!(|bytes: &[u8]| ikeya_slice(bytes) ^ ucp_slice(bytes));
