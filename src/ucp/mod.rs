//! UCP: the UART link between a rover's Linux board (the host) and its STM32 (the robot).
//!
//! # On the wire
//!
//! 115,200 bit/s, 8 data bits, no parity, 1 stop bit. All numbers are little-endian.
//!
//! ```text
//! byte        0     1     2     3     4     5      6 ...
//! frame       FD    FF    len: u16    id    index  body ...   crc: u16
//! ```
#![doc = include_str!("messages.md")]
//!
//! Id and body length together identify the message, so the direction need not be known.
//!
//! # Decoding
//!
//! [`Decoder`] finds frames, [`Frame::message`] reads one. [`message`] has all messages.
//!
//! ```
//! use axlewire::{stream::Event, ucp::{self, Message}};
//!
//! let mut decoder = ucp::Decoder::new();
//! let mut line: &[u8] = &[0x00, 0xFD, 0xFF, 4, 0, 1, 0, 0x01, 0x42]; // a stray byte, a ping
//! while let Some(event) = decoder.decode(&mut line) {
//!     match event {
//!         Event::Frame(frame) => assert!(matches!(frame.message(), Message::Ping(_))),
//!         Event::Skipped(gap) => assert_eq!(gap.len, 1),
//!     }
//! }
//! assert_eq!(decoder.counters().framed, 8);
//! ```
//!
//! # Printing
//!
//! Frames and messages print themselves on one line, with units; [`Message::name`] and
//! [`Message::contents`] are the parts for a table. With feature `serde` they are data, whose
//! fields are described on the page `fields`. Nothing allocates.
//!
//! ```
//! use axlewire::ucp::{Body, Frame, message::{ErrorCode, Pong}};
//!
//! let sent = Pong::new(ErrorCode::Fine).frame(7);
//! let frame = Frame::parse(sent.as_bytes())?;
//! assert_eq!(frame.to_string(), "pong, index 7: fine");
//! let message = frame.message();
//! assert_eq!((message.name(), &*message.contents().to_string()), ("pong", "fine"));
//! # Ok::<(), axlewire::error::ParseError>(())
//! ```
//!
//! # Encoding
//!
//! [`Body::frame`] makes a whole frame of a message that may be sent.
//!
//! ```
//! use axlewire::ucp::{Body, Frame, Message, MotorControl};
//!
//! let sent = MotorControl::turn_right(60, 20)?.frame(7);
//! let Message::MotorControl(command) = Frame::parse(sent.as_bytes())?.message() else { panic!() };
//! assert_eq!((sent.index(), command.speed(), command.angular()), (7, 60, 20));
//! assert!(MotorControl::new(101, 0).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Roles
//!
//! [`Host`] and [`Robot`] do the talking, without a clock or a port, see
//! [`endpoint`](crate::endpoint): repetition, timeouts and safety; `drive::Driver` gives them clock
//! and port. Their settings, events and statistics are in [`host`] and [`robot`].
//!
//! # Rulings
//!
//! Where the protocol document is silent, unclear or wrong, this crate decides:
//!
//! * **B1, U1** The CRC covers every byte before it, FD FF included, and is sent low byte first.
//!   `len` is 4 + body length, which is the frame length minus 4.
//! * **U2** `len` 4..=60 is accepted by default; a larger cap, at most 252, can be chosen. `len`
//!   above 60 is never sent.
//! * **U3** A good frame with an unknown id, or with a body length that no message has, is
//!   delivered as [`Message::Unknown`]: never dropped, never misread.
//! * **U4** The table above.
//! * **U5** Two report layouts, distinguished by their length; [`Telemetry`] holds their common
//!   fields, raw and in SI units. A battery above 100 % is kept raw and flagged.
//! * **U6** The document says that a positive `angular` turns left; the vendor firmware and three
//!   host programs turn right. The wire value passes through; [`MotorControl::turn_right`] and
//!   [`MotorControl::turn_left`] follow the firmware. `angular` is a steering wheel, not a yaw
//!   rate: in reverse the nose swings the other way. [`MotorControl::yaw_right`] and
//!   [`MotorControl::yaw_left`] name the side to which the nose swings.
//! * **U7** `speed` and `angular` are -100..=100; out of range is an error. `front_led` is 100 or
//!   0. `version` and the reserved fields are 0, because a `version` above 38 starts a firmware
//!   update. A command to be sent is therefore a [`MotorControl`], which cannot hold other values;
//!   a received one is a [`RawMotorControl`], which cannot be framed. Likewise only
//!   [`OtaRequest::start_firmware_update`] makes an [`OtaRequest`], and a received one is a
//!   [`RawOtaRequest`].
//! * **U8** Network states are 0 to 4. One byte is sent, one or four are read, and unknown values
//!   are kept.
//! * **U9** `index` is a wrapping counter per sender; a gap in it is never an error.
//! * **U10** [`Host`] repeats the latest motor command every 100 ms, and sends zero when its
//!   application has been silent for 500 ms, or the robot has not been heard for as long. [`Robot`]
//!   stands still 500 ms after the last *valid* motor command; the vendor firmware accepts any byte
//!   instead. Reports come every 20 ms, and the link is lost after 500 ms without a valid frame.
//! * **U11** A calibration's start and end are acknowledged at once. Its result and the robot's
//!   request for biases at boot are repeated every 1000 ms until answered. The host keeps the
//!   results in a [`BiasStore`], and sends those stored at the moment of sending.
//! * **U12** Pong 0 means fine; 1 means that the ping arrived damaged.
//! * **U13** Never sent: a report by a host, a body shorter than its message, `len` above 60. Each
//!   of these hangs or corrupts shipped robots, so no constructor makes one, and a frame cast from
//!   bytes with the id or length of another is not encoded. Nor is a [`RawFrame`] with a second FD
//!   FF: shipped robots give it up at its id, and take what follows there for a frame. Only
//!   [`Frame::relay_unchecked`] passes on whatever was received.
//! * **U14** Firmware built from the vendor's main branch hangs forever on any frame with an id in
//!   5..=0x0A, the answer to its own boot request included. v6.38, which ships, does not.
//!   [`HostConfig::low_ids_only`] is the switch for such builds. To recognise one: the first ping
//!   after the biases is never answered.
//! * **U15** A result, a calibration's start or end, or a set of biases is acknowledged, and a
//!   request no longer repeated, only after it is where the application will find it: in the store,
//!   or in an event queue that had room. Half of each queue is reserved for rare events.
//! * **U16** Motor frames are never answered, so a stop is done when it has been flushed:
//!   [`Host::is_stop_sent`]. A frame that did not reach the line makes the motor command due again,
//!   twice if the frame was cut off or its flush failed. Whether the robot obeys is in its reports,
//!   averages of the last 1.1 s ([`HostConfig::rpm_average`]): [`Host::stop_progress`], and
//!   `await_standstill` of a driver. A vendor robot that has restarted reports 0 until it moves: if
//!   its reports show a restart, they show a standstill only [`host::COAST`] later. A robot that
//!   has not been heard for 500 ms is told to stand still, and commands to move are refused until
//!   it is heard again ([`CommandError::LinkDown`]). The first frame of a host is a zero motor
//!   command, because a vendor robot keeps driving while any byte arrives: a restarted host that
//!   only pings would keep it moving. To disable this for hosts that only listen, clear
//!   [`HostConfig::sends_first_stop`].
//!
//! [`BiasStore`]: host::BiasStore
//! [`CommandError::LinkDown`]: host::CommandError::LinkDown
//! [`HostConfig::low_ids_only`]: host::HostConfig::low_ids_only
//! [`HostConfig::rpm_average`]: host::HostConfig::rpm_average
//! [`HostConfig::sends_first_stop`]: host::HostConfig::sends_first_stop
//! [`OtaRequest`]: message::OtaRequest
//! [`OtaRequest::start_firmware_update`]: message::OtaRequest::start_firmware_update
//! [`RawMotorControl`]: message::RawMotorControl
//! [`RawOtaRequest`]: message::RawOtaRequest

mod batch;
mod body;
mod catalogue;
mod codes;
mod contents;
pub(crate) mod fields;
mod frame;
mod framing;
mod header;
pub mod host;
mod inbox;
pub mod message;
mod motor;
mod plain;
mod report;
pub mod robot;
mod role;
#[cfg(feature = "serde")]
mod serialize;
#[cfg(all(test, feature = "serde"))]
mod tests;
mod update;
mod value;

pub use contents::Contents;
pub use frame::{Body, Frame, FrameOf, RawFrame, RelayedFrame};
pub use framing::{Decoder, Ucp};
pub use header::{BAUD, Header, MAX_LEN, MessageId, SYNC};
pub use host::role::Host;
#[doc(inline)]
pub use message::Message;
pub use motor::MotorControl;
pub use report::Telemetry;
pub use robot::role::Robot;
