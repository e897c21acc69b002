//! Ikeya MD: a motor-driver bus over RS485, one master and up to eight slaves.
//!
//! # On the wire
//!
//! 500 kbit/s, 8 data bits, no parity, 1 stop bit, full duplex over four wires. All numbers are
//! little-endian; the CRC covers every byte before it (ruling B1).
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
//! # Decoding
//!
//! [`ToMaster`] finds responses, [`ToSlave`] requests, [`BothDirections`] both. None of them waits
//! for more than the packet that a header announces, at most 8 bytes.
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
//!
//! # Printing
//!
//! [`Packet`], [`Request`] and [`Response`] print themselves on one line, with units;
//! [`name`](Packet::name), [`id`](Packet::id) and [`contents`](Packet::contents) are the parts for
//! a table. With feature `serde` they are data, whose fields are described on the page `fields`.
//! Nothing allocates. A WRITE shows both readings, unless you know the mode of its node:
//! [`Contents::in_mode`].
//!
//! ```
//! use axlewire::ikeya::{NodeId, Position, PositionResponse, Response};
//!
//! let at = PositionResponse::new(NodeId::N3, Position::new(4096, 1));
//! assert_eq!(
//!     Response::Position(&at).to_string(),
//!     "position_response, node 3: 1.5000 turns (rotation 1, count 4096)",
//! );
//! ```
//!
//! # Encoding
//!
//! A packet is built by a constructor, which takes only values that exist, and knows its bytes.
//!
//! ```
//! use axlewire::ikeya::{NodeId, Rps, WriteRequest};
//!
//! let turn = WriteRequest::velocity(NodeId::N2, Rps::from_rpm(60.0)?); // 1 revolution per second
//! assert_eq!(turn.as_bytes(), &[0xBB, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x43, 0x40]);
//! assert!(Rps::new(f32::NAN).is_err());
//! # Ok::<(), axlewire::error::EncodeError>(())
//! ```
//!
//! # Roles
//!
//! [`Master`] and [`Slave`] speak the protocol without a clock or a port, see
//! [`endpoint`](crate::endpoint); `drive::Driver` gives them both. Their settings, events and
//! statistics are in [`master`] and [`slave`]. [`Schedule`] computes how fast a bus can be, before
//! it is wired. Boards with three motors: [`board`] and [`three`].
//!
//! # Rulings
//!
//! Where the protocol document is silent, unclear or wrong, this crate decides:
//!
//! * **B5, B6** Little-endian on every machine. A byte takes 10 bit times, not 8: the document's 64
//!   and 128 µs are 80 and 160 µs.
//! * **I1** Wire ids are 1..=8. Id 0 is the master's and never appears on the wire. A complete
//!   packet with a good CRC and any other id is refused as
//!   [`Reason::Id`](crate::stream::Reason::Id) and skipped as a whole.
//! * **I2** The document's two DIP switch examples contradict each other: you choose the reading
//!   for [`DipSwitch`]. To find the truth, scan ids 1..=8 with READ.
//! * **I3** One [`WriteRequest`], two constructors, two readings: its bytes do not tell a speed
//!   from a position. A WRITE is not answered.
//! * **I4** Any `f32` and any `i16` decodes. NaN and infinities are refused on encoding, by [`Rps`]
//!   and by a velocity response that was received; a slave refuses them on receipt as well. The
//!   document's ±32767 is a slip: -32768 is legal.
//! * **I5** A [`Position`] is `rotation · 8192 + count` counts, an `i32`. Splitting counts
//!   truncates unless you choose otherwise; out of range is an error, never a wrap or a clamp.
//! * **I6** Position mode has no stop: a stop reads the node and then writes back the position of
//!   that answer, never "go to 0". An older position is used only if [`MasterConfig::hold_age`]
//!   allows it. The position then becomes the set-point, and is measured again only for another
//!   stop, after the node was abnormal or its mode in doubt, or if no answer follows its first
//!   WRITE within 20 ms, or longer if that was too short before. Except after a doubt it is kept
//!   unless the node is more than 256 counts (1/32 of a turn) away: a loaded motor stands beside
//!   the position that it holds.
//! * **I7** The reply timeout, 500 µs by default, runs from the end of the request on the wire, and
//!   the answer's own wire time is added. Bytes received before the request are dropped. Answers
//!   from another node, of another kind or after the deadline are counted, and never accepted.
//!   While a port may hold a request back, the next one waits for it, and answers that may belong
//!   to either are not accepted. Three windows in a row without the answer make a node abnormal,
//!   one answer brings it back, and a WRITE changes nothing. [`Master`] follows this.
//! * **I8** A READ is repeated, with three attempts by default. A WRITE is silent, so the latest
//!   set-point is repeated in every cycle and, on request, confirmed by a READ.
//! * **I9** A slave follows foreign traffic to stay in step, answers only a READ for its own id,
//!   and keeps the last command on any error. [`Slave`] does; it should take no longer than 50 µs
//!   from the last byte of the request to the first byte of the answer.
//! * **I10** Boards with three motors use the 16-byte packets of [`three`], with the same headers.
//!   They are a separate framing that you choose.
//! * **I11** A good answer in a mode other than the one on record, even a late one, puts the mode
//!   in doubt. The node is read again at once; if the next answer agrees with the new mode, the
//!   mode changes and the set-point ends. While in doubt, nothing is written or confirmed,
//!   set-points are refused, and a stop waits, unless it holds a position, measured after the stop
//!   was requested, that a velocity node would read as standstill (rotation 0..=12287). Six
//!   exchanges without a decision produce an event, and the node is then read at the search rate. A
//!   WRITE of which only a part has left when a doubt arises is given up. A mode that changes owes
//!   a stop to every node that has ever had a WRITE, whatever was stopped or released since: a
//!   repeated 0 rps may have been read as "go to 0".
//! * **I12** A stop is owed from the call until the node is *seen to be still*. It is *confirmed*
//!   once two stop WRITEs have each been followed by an answer from the node in its mode; until
//!   then set-points are refused. The node is *still* once two answers behind a stop WRITE, at
//!   least 20 ms apart, both show less than 0.05 rps, or positions within 8 counts of each other; a
//!   position node that comes back to its hold passes a place twice, so the crate takes a third,
//!   and none of them may be more than 256 counts away from the hold. An answer may have been
//!   measured 1 ms after its request, however late it comes. Until then, or until a new set-point,
//!   the stop is written with every reading, at least every 20 ms, whatever the polling: an answer
//!   shows that the READ was heard, not the WRITE. A node that is polled and moves again is no
//!   longer still; one that is not polled gets no WRITE once it is. A stop survives abnormal nodes,
//!   port errors and a full event queue, and a release does not cancel it. A node that is confirmed
//!   and still moves after [`MasterConfig::coast`] is reported once. Ids that have never answered
//!   are read first. A node that becomes abnormal while under a set-point is owed a stop, because
//!   slaves keep their last command.
//! * **I13** Stops of nodes that answer go first: velocity WRITEs, then position nodes in turn. An
//!   abnormal node gets one attempt at once. From then on a velocity node gets a blind stop WRITE
//!   after every exchange, at most every 20 ms, and a position node its stop after its next good
//!   answer. READs of nodes that were heard before and are owed a stop take every other turn of the
//!   search, and an idle line belongs to the search: on a line of 500 kbit/s, 0 rps reaches a
//!   velocity node with one motor within 50 ms after its cable is back. Then come new set-points,
//!   in turn, then a discovery, then the cycle. A master can have a dead-man.
//! * **I14** A slave drops an answer when more bytes arrived before it was sent, or when it is too
//!   late. On two wires it also follows the answers of other nodes.
//!
//! [`DipSwitch`]: slave::DipSwitch
//! [`MasterConfig::coast`]: master::MasterConfig::coast
//! [`MasterConfig::hold_age`]: master::MasterConfig::hold_age
//! [`Schedule`]: master::Schedule

mod batch;
pub mod board;
mod contents;
pub(crate) mod fields;
mod framing;
mod judge;
pub mod master;
mod node_set;
mod schedule;
#[cfg(feature = "serde")]
mod serialize;
pub mod slave;
pub mod three;
mod units;
mod wire;

#[doc(inline)]
pub use board::{Status, Target};
pub use contents::Contents;
pub use framing::{BothDirections, Decoder, MAX_LEN, Packet, Request, Response, ToMaster, ToSlave};
pub use master::role::Master;
pub use slave::role::Slave;
pub use units::{BAUD, Mode, NodeId, Position, Rps};
pub use wire::{PositionResponse, ReadRequest, VelocityResponse, WriteRequest};
