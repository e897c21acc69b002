//! Ikeya MD: a motor-driver bus over RS485, one master and up to eight slaves.
//!
//! # On the wire
//!
//! 500 kbit/s, 8 data bits, no parity, 1 stop bit, full duplex over four wires. All numbers are
//! little-endian; the CRC covers every byte in front of it (ruling B1).
//!
//! ```text
//! byte        0     1     2     3     4     5     6     7
//! READ        AA    id    crc ------                               master to slave   80 µs
//! WRITE       BB    id    payload --------------    crc ------     master to slave  160 µs
//! velocity    55    id    rps: f32 -------------    crc ------     slave to master  160 µs
//! position    56    id    count: i16  rot.: i16     crc ------     slave to master  160 µs
//! ```
//!
//! A slave answers a READ for its own id within about 50 µs, and never answers a WRITE.
//!
//! # Rulings
//!
//! Where the protocol document is silent, unclear or wrong, this crate decides:
//!
//! * **B5, B6** Little-endian on every machine. A byte takes 10 bit times, not 8: the document's 64
//!   and 128 µs are 80 and 160 µs.
//! * **I1** Wire ids are 1..=8. Id 0, the master's, stands in no packet. A whole packet with a good
//!   CRC and any other id is refused as [`Reason::Id`](crate::stream::Reason::Id) and skipped whole.
//! * **I2** The document's two DIP switch examples contradict each other: [`DipSwitch`] takes the
//!   reading from you. Scan ids 1..=8 with READ to find the truth.
//! * **I3** One [`WriteRequest`], two constructors, two readings: its bytes do not tell a speed from
//!   a position. A WRITE is not answered.
//! * **I4** Any `f32` and any `i16` decodes. NaN and infinities are refused on encoding, by [`Rps`];
//!   a slave refuses them on receipt as well. The document's ±32767 is a slip: -32768 is legal.
//! * **I5** A [`Position`] is `rotation · 8192 + count` counts, an `i32`. From counts the split
//!   truncates unless asked otherwise; out of range is an error, never a wrap or a clamp.
//! * **I6** There is no stop in position mode: stopping such a node means holding the last measured
//!   position, never going to 0.
//! * **I7** The reply timeout, 500 µs unless set otherwise, runs from the end of the request on the
//!   wire, and the answer's own wire time is added. Bytes left from before the request are dropped;
//!   answers of another node or another kind, or after the deadline, are counted and never taken.
//!   Three windows in a row without the answer make a node abnormal, one answer brings it back, and
//!   a WRITE changes nothing. [`Master`] keeps to it.
//! * **I8** A READ is repeated, three attempts unless set otherwise. A WRITE is silent, so the latest
//!   set-point is repeated in every cycle and, where asked, confirmed by a READ.
//! * **I9** A slave follows foreign traffic to stay in step, answers only a READ for its own id, and
//!   keeps the last command on any error. [`Slave`] does; from the last byte of the request to the
//!   first of the answer it should not take longer than 50 µs.
//! * **I10** Boards with three motors use the 16-byte packets of [`three`], with the same headers.
//!   They are another framing, chosen by you.
//!
//! # Roles
//!
//! [`Master`] and [`Slave`] speak the protocol without a clock and without a port, see
//! [`endpoint`](crate::endpoint). [`Schedule`] tells how fast a bus can be before it is wired.
//!
//! # Decoding
//!
//! [`ToMaster`] finds responses, [`ToSlave`] requests, [`Either`] both. None of them waits for more
//! than the packet that a header promises, at most 8 bytes.
//!
//! ```
//! use axlewire::{ikeya, stream::Event};
//!
//! let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
//! let mut line: &[u8] = &[0x00, 0xAA, 0x01, 0xBE, 0xD0]; // a stray byte, READ for node 1
//! while let Some(event) = decoder.decode(&mut line) {
//!     match event {
//!         Event::Frame(ikeya::Request::Read(read)) => assert_eq!(read.id().get(), 1),
//!         Event::Frame(ikeya::Request::Write(_)) => unreachable!(),
//!         Event::Skipped(gap) => assert_eq!(gap.len, 1),
//!     }
//! }
//! assert_eq!(decoder.counters().framed, 4);
//! ```

mod board;
mod framing;
mod master;
mod runs;
mod schedule;
pub(crate) mod slave;
mod sweep;
pub mod three;
mod units;
mod wire;

pub use board::{Board, Command, OneMotor, Status, Target, ThreeMotors};
pub use framing::{Either, Packet, Request, Response, ToMaster, ToSlave};
pub use master::{
    Cause, CommandError, Health, Master, MasterConfig, MasterEvent, MasterStatistics,
    NodeStatistics, Polling,
};
pub use schedule::Schedule;
pub use slave::{Slave, SlaveConfig, SlaveEvent, SlaveStatistics};
pub use units::{DipSwitch, IdReading, Mode, NodeId, Position, Rps};
pub use wire::{PositionResponse, ReadRequest, VelocityResponse, WriteRequest};

/// Speed of the line, bit/s.
pub const BAUD: u32 = 500_000;

/// Longest packet of a standard bus, bytes.
pub const MAX_LEN: usize = WriteRequest::LEN;

/// Decoder with the smallest buffer that a standard bus needs.
pub type Decoder<F = ToMaster> = crate::stream::Decoder<F, MAX_LEN>;
