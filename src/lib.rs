//! Two serial protocols for motors and rovers, the same code in firmware and on a host.
//!
//! * [`ikeya`]: **Ikeya MD**, an RS485 bus of up to eight motor drivers, 500 kbit/s.
//! * [`ucp`]: **UCP**, the UART between a rover's Linux board and its STM32, 115,200 bit/s.
//!
//! Both ends of each: what a master or a host needs, and what a slave or a robot needs.
//!
//! # The floors
//!
//! Bytes go up, commands come down, and each floor knows only the one below.
//!
//! | floor | what it does | where |
//! |---|---|---|
//! | drive | moves bytes between a port and a role; the calls that a user wants first | [`drive`] |
//! | roles | who speaks when, what a timeout means, what is safe: masters, slaves, hosts, robots | [`endpoint`], [`ikeya`], [`ucp`] |
//! | ports | frames in and out of an `embedded-io` port | [`io`] |
//! | stream | finds frames in bytes, counts every byte, resyncs after noise | [`stream`] |
//! | wire | typed packets: views without a copy, values with the right CRC | [`ikeya`], [`ucp`] |
//! | checksum | CRC-16/MODBUS without a table | [`crc16`] |
//!
//! Nothing here allocates, blocks, reads a clock or panics, except that `drive` and `io` wait for their
//! port, `drive` asks the clock that it is given, and [`stream::decode_capture`](stream) collects into
//! a `Vec`. There is no `unsafe` in this crate.
//!
//! **Before a motor is connected, read [`safety`]**: what can move or fail to stop, what this crate does
//! about it, and what is left to you.
//!
//! # A motor bus
//!
//! ```
//! # #[cfg(feature = "ikeya")] {
//! use axlewire::{ikeya::{self, NodeId, Response, Rps, WriteRequest}, stream::Event};
//!
//! // A command: refused here if it could not be meant.
//! let turn = WriteRequest::velocity(NodeId::N2, Rps::from_rpm(60.0)?);
//! assert_eq!(turn.as_bytes(), &[0xBB, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x43, 0x40]);
//!
//! // An answer, with a stray byte in front of it, in two pieces.
//! let mut decoder = ikeya::Decoder::<ikeya::ToMaster>::new();
//! for mut bytes in [&[0x00, 0x55, 0x02, 0x00][..], &[0x00, 0x80, 0x3F, 0x54, 0x0E]] {
//!     while let Some(event) = decoder.decode(&mut bytes) {
//!         match event {
//!             Event::Frame(Response::Velocity(now)) => assert_eq!(now.rps(), 1.0),
//!             Event::Frame(Response::Position(_)) => unreachable!("node 2 is in velocity mode"),
//!             Event::Skipped(gap) => println!("{} bytes of noise: {}", gap.len, gap.reason),
//!         }
//!     }
//! }
//! assert_eq!(decoder.counters().frames, 1);
//! # }
//! # Ok::<(), axlewire::error::EncodeError>(())
//! ```
//!
//! # A rover
//!
//! ```
//! # #[cfg(feature = "ucp")] {
//! use axlewire::{stream::Event, ucp::{self, message::FirmwareReport, Body, Message, MotorControl, Telemetry}};
//!
//! // Host to robot: half speed ahead, a little to the right.
//! let drive = MotorControl::turn_right(50, 10)?.frame(0);
//! assert_eq!(drive.as_bytes().len(), 24);
//!
//! // Robot to host: a report every 20 ms.
//! let values = Telemetry { battery_pct: 87, voltage_dv: 119, ..Telemetry::default() };
//! let sent = FirmwareReport::new(&values, 38).frame(0);
//!
//! let mut decoder = ucp::Decoder::new();
//! let mut line: &[u8] = sent.as_bytes();
//! while let Some(event) = decoder.decode(&mut line) {
//!     let Event::Frame(frame) = event else { continue };
//!     if let Message::Report(report) = frame.message() {
//!         let now = report.telemetry();
//!         assert_eq!((now.battery(), now.volts()), (Some(87), 11.9));
//!     }
//! }
//! # }
//! # Ok::<(), axlewire::error::EncodeError>(())
//! ```
//!
//! # Features
//!
//! | feature | default | brings |
//! |---|---|---|
//! | `ikeya` | yes | the motor bus |
//! | `ucp` | yes | the rover link |
//! | `embedded-io` | yes | [`drive::Driver`], [`io::FrameReader`] and [`io::FrameWriter`], blocking |
//! | `embedded-io-async` | | the same calls, async |
//! | `embedded-hal` | | [`drive::Rs485`]: the driver-enable pin of an RS485 port |
//! | `alloc` | | [`stream::decode_capture`](stream): a whole capture at once |
//! | `std` | | `alloc`, `std::io` errors in the port traits, [`drive::StdClock`](drive) |
//! | `arbitrary` | | value types made from fuzz input; brings `std` |
//! | `bytemuck` | | `CheckedBitPattern` and `NoUninit` for packets, `Pod` for bodies but `MotorControl` |
//! | `defmt` | | `Format` for everything |
//! | `serde` | | values as data |
//! | `simd` | | AVX2 in [`Frames::each`](stream::Frames::each) and in the search, on an x86-64 processor that has it; brings `std` |
//! | `sim` | | [`sim`]: a line with faults in virtual time, a motor, a rover; brings `std` |
//!
//! All are additive, and every combination builds.
//!
//! # Rulings
//!
//! Where a protocol document is silent, unclear or wrong, a numbered ruling decides. B1 to B6 hold
//! for both protocols, I1 to I14 for [`ikeya`], U1 to U16 for [`ucp`]; they are on those pages and,
//! for B2 to B4, in [`stream`]. B1: the CRC is CRC-16/MODBUS over every byte in front of it, low
//! byte first. B5: the wire is little-endian on every machine. B6: a byte takes 10 bit times.

#![no_std]
#![warn(clippy::alloc_instead_of_core, clippy::std_instead_of_alloc, clippy::std_instead_of_core)]
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod crc16;
#[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
pub mod drive;
pub mod encode;
pub mod endpoint;
pub mod error;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod events;
#[cfg(feature = "ikeya")]
pub mod ikeya;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod inbox;
#[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
pub mod io;
mod machine;
#[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
mod outbox;
// A page, not code. Its examples use the features named here.
#[cfg(all(
    any(doc, doctest),
    feature = "embedded-hal",
    feature = "embedded-io",
    feature = "ikeya",
    feature = "ucp"
))]
#[doc = include_str!("porting.md")]
pub mod porting {}
// A page, not code.
#[cfg(all(any(doc, doctest), feature = "embedded-io", feature = "ikeya", feature = "ucp"))]
#[doc = include_str!("safety.md")]
pub mod safety {}
#[cfg(feature = "sim")]
pub mod sim;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub mod stats;
pub mod stream;
pub mod time;
#[cfg(feature = "ucp")]
pub mod ucp;

/// The examples of the README are tests, too.
#[cfg(all(doctest, feature = "ikeya", feature = "ucp"))]
#[doc = include_str!("../README.md")]
struct Readme;
