#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
//! draft

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod crc16;
pub mod error;
#[cfg(feature = "ikeya")]
pub mod ikeya;
#[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
pub mod io;
pub mod stream;
#[cfg(feature = "ucp")]
pub mod ucp;
