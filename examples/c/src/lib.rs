//! axlewire for C and C++: everything of the crate that needs no port, behind `axlewire.h`.
//!
//! The header is made from this package by `header.sh`; its comments are the documentation. Objects
//! live in memory of the caller; nothing here allocates, calls back or keeps a global.
//!
//! This is the only package with `unsafe`: `memory` checks what can be checked of a pointer, and
//! each block says what the caller of the C function has promised.

#![cfg_attr(not(feature = "std"), no_std)]

#[macro_use]
mod kinds;
#[macro_use]
mod memory;
#[macro_use]
mod endpoint;
mod crc;
mod ikeya;
mod result;
mod stream;
mod time;
mod ucp;

pub use crc::*;
pub use endpoint::*;
pub use ikeya::*;
pub use result::*;
pub use stream::*;
pub use time::*;
pub use ucp::*;

/// No input reaches it: `check.sh` shows that firmware links without it.
#[cfg(not(feature = "std"))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
