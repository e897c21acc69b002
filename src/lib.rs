//! Two serial protocols for motors and rovers: the same code in firmware and on a host.
//!
//! * `ikeya`: **Ikeya MD**, an RS485 bus of up to eight motor drivers, 500 kbit/s.
//! * `ucp`: **UCP**, the UART between a rover's Linux board and its STM32, 115,200 bit/s.
//!
//! Both ends of each: master and slave, host and robot.
#![doc = include_str!("guarantees.md")]
//!
//! **Before you connect a motor, read the page `safety`**: what can move or fail to stop, what this
//! crate does about it, and what is left to you.
//!
//! # Where to start
//!
//! | you want to | see |
//! |---|---|
//! | learn it step by step | the pages of `guide` |
//! | turn a motor or drive a rover over a port | `drive::Driver` |
//! | run a role in your own loop, without a port and a clock | [`endpoint::Endpoint`] |
//! | build a packet, decode a stream | the pages `ikeya` and `ucp` |
//! | decode a file of recorded bytes | `stream::decode_capture` |
//! | decode another protocol with the same resync | [`stream::Framing`] |
//! | bring it to a board | `guide::start_on_a_board` |
//! | use a serial port or a USB adapter of a PC | `guide::start_on_a_pc` |
//! | read packets as JSON, or elsewhere with `serde` | the page `fields` |
//! | test roles and applications in virtual time, without ports | `sim` |
//!
//! # The floors
//!
//! Bytes go up, commands come down. Each floor uses only those below it; `drive` and `io` are two
//! doors to the same house and do not know each other.
//!
//! | floor | what it does | where |
//! |---|---|---|
//! | drive | moves bytes between a port and a role; high-level calls | `drive` |
//! | io | frames in and out of an `embedded-io` port, without a role | `io` |
//! | roles | who sends what and when, what a timeout means, what is safe | [`endpoint`], `ikeya`, `ucp` |
//! | wire | typed packets: views without a copy, values with the right CRC | `ikeya`, `ucp`, [`encode`] |
//! | stream | finds frames in bytes, accounts for every byte, resyncs after noise | [`stream`] |
//! | checksum | CRC-16/MODBUS without a table | [`crc16`] |
//!
//! Nothing here allocates, blocks, reads a clock or panics, with these exceptions: `drive` and `io`
//! wait for their port, `drive` asks the clock that it is given, `stream::decode_capture` and `sim`
//! collect into `Vec`s, and `TokioSerialPort::open` needs a runtime with I/O.
//!
//! # Features
#![doc = include_str!("features.md")]
//!
//! All are additive, and every combination builds.
//!
//! # Rulings
//!
//! Where a protocol document is silent, unclear or wrong, a numbered ruling decides. B1 to B6 hold
//! for both protocols, I1 to I14 for `ikeya`, U1 to U16 for `ucp`. Those pages list them;
//! [`stream`] lists B2 to B4. B1: the CRC is CRC-16/MODBUS over every byte in front of it, low byte
//! first. B5: the wire is little-endian on every machine. B6: a byte takes 10 bit times.

#![no_std]
#![warn(clippy::alloc_instead_of_core, clippy::std_instead_of_alloc, clippy::std_instead_of_core)]
#![cfg_attr(docsrs, feature(doc_cfg))]
// No panic that input can reach.
#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod crc16;
pub mod drive;
pub mod encode;
pub mod endpoint;
pub mod error;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod events;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod field;
// Its page is about both protocols.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
#[cfg_attr(
    not(all(feature = "ikeya", feature = "ucp")),
    doc = "The fields of messages as a table."
)]
pub mod fields;
#[cfg(feature = "ikeya")]
pub mod ikeya;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod inbox;
pub mod io;
mod machine;
#[cfg(all(feature = "serde", any(feature = "ikeya", feature = "ucp")))]
mod map;
mod outbox;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod record;
// Pages, not code.
#[cfg(all(any(doc, doctest), feature = "ikeya", feature = "ucp"))]
pub mod guide;
#[cfg(all(any(doc, doctest), feature = "ikeya", feature = "ucp"))]
#[doc = include_str!("safety.md")]
pub mod safety {}
#[cfg(feature = "sim")]
pub mod sim;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub mod stats;
pub mod stream;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod text;
pub mod time;
#[cfg(feature = "ucp")]
pub mod ucp;

/// Runs the examples of the README as tests.
#[cfg(all(doctest, feature = "serialport", feature = "ikeya", feature = "ucp"))]
#[doc = include_str!("../README.md")]
struct Readme;
