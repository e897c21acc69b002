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
//!
//! ```text
//! id          to the robot                          to the host
//! 1           Ping 0                                Pong 1
//! 2           MotorControl 16, every 100 ms
//! 3           CalibrationStart 1                    CalibrationStartAck 2
//! 4           CalibrationEnd 1                      CalibrationEndAck 2
//! 5                                                 FirmwareReport 36 or DocumentReport 34, every 20 ms
//! 6           ImuBiasAck 1                          ImuBias 12
//! 7           MagBiasAck 1                          MagBias 6
//! 8           Biases 19                             BiasRequest 0
//! 9           OtaRequest 2                          OtaAck 1
//! 0A          SetNetworkState 1, or 4
//! ```
//!
//! The numbers are body lengths in bytes. Id and body length together name the message, so no
//! direction has to be known.
//!
//! # Rulings
//!
//! Where the protocol document is silent, unclear or wrong, this crate decides:
//!
//! * **B1, U1** The CRC covers every byte in front of it, FD FF included, and is sent low byte
//!   first. `len` is 4 + body length, which is the frame length minus 4.
//! * **U2** `len` 4..=60 is accepted unless a larger cap is chosen, at most 252; never sent above 60.
//! * **U3** A good frame with an unknown id, or with a body length that no message has, is delivered
//!   as [`Message::Unknown`]: never dropped, never misread.
//! * **U4** The table above.
//! * **U5** Two report layouts, told apart by their length; [`Telemetry`] is what both have, raw and
//!   in SI units. A battery above 100 % is kept raw and flagged.
//! * **U6** The document says that a positive `angular` turns left, the vendor firmware and three
//!   host programs turn right. The wire value passes through; [`MotorControl::turn_right`] and
//!   [`MotorControl::turn_left`] follow the firmware.
//! * **U7** `speed` and `angular` are -100..=100, out of range is an error. `front_led` is 100 or 0.
//!   `version` and the reserved fields are 0, because a `version` above 38 starts a firmware update.
//! * **U8** Network states 0 to 4, one byte sent, one or four read, unknown values kept.
//! * **U9** `index` is a wrapping counter per sender; a gap in it is never an error.
//! * **U10, U11** say who repeats what and when each side gives up. [`Host`] and [`Robot`] keep them:
//!   motor commands every 100 ms and a dead-man at 500 ms, a watchdog of 500 ms on valid commands,
//!   reports every 20 ms, results and the request for biases every 1000 ms until answered.
//! * **U12** Pong 0 means fine, 1 that the ping arrived damaged.
//! * **U13** Never sent: a report by a host, a body shorter than its message, `len` above 60. Each
//!   hangs or corrupts shipped robots, so no constructor makes one.
//!
//! # Layers
//!
//! [`Decoder`] finds frames, [`Frame::message`] reads one, [`Body::frame`] builds one. [`Host`] and
//! [`Robot`] do the talking: who repeats what, who waits how long, what is safe.
//!
//! # Decoding and encoding
//!
//! ```
//! use axlewire::{stream::Event, ucp::{self, Body, Message, MotorControl}};
//!
//! let sent = MotorControl::turn_right(60, 20)?.frame(7);
//!
//! let mut decoder = ucp::Decoder::new();
//! let mut line: &[u8] = sent.as_bytes();
//! let Some(Event::Frame(frame)) = decoder.decode(&mut line) else { panic!() };
//! let Message::MotorControl(command) = frame.message() else { panic!() };
//! assert_eq!((frame.index(), command.speed(), command.angular()), (7, 60, 20));
//! # Ok::<(), axlewire::error::EncodeError>(())
//! ```

mod bias;
mod codes;
mod framing;
mod header;
mod host;
#[cfg(all(feature = "simd", target_arch = "x86_64"))]
mod lanes;
mod message;
mod report;
mod robot;
mod role;

pub use bias::{BiasStore, MemoryStore, NoStore, NotStored};
pub use codes::{CalibrationKind, ErrorCode, NetworkState, OtaStatus};
pub use framing::{Frame, FrameOf, RawFrame, Ucp};
pub use header::{Header, MessageId, SYNC};
pub use host::{
    CalibrationFailure, CalibrationStep, CommandError, FailureCause, Host, HostConfig, HostEvent,
    HostStatistics, Link, ReceivedReport, RoundTrip, UnknownFrame,
};
pub use message::{
    BiasRequest, Biases, Body, CalibrationEnd, CalibrationEndAck, CalibrationStart,
    CalibrationStartAck, ImuBias, ImuBiasAck, MagBias, MagBiasAck, Message, MotorControl, OtaAck,
    OtaRequest, Ping, Pong, SetNetworkState, SetNetworkStateWide,
};
pub use report::{DocumentReport, FirmwareReport, Report, Telemetry};
pub use robot::{ReportLayout, Robot, RobotConfig, RobotEvent, RobotStatistics, UpdateSource};

/// Speed of the line, bit/s.
pub const BAUD: u32 = 115_200;

/// Longest frame that is sent, and that is accepted by default, bytes (ruling U2).
pub const MAX_LEN: usize = 64;

/// Longest body that is sent, bytes.
pub const MAX_BODY_LEN: usize = MAX_LEN - Header::LEN - 2;

/// `len` of a frame without a body.
const LEN_WITHOUT_BODY: usize = 4;

/// Decoder with the default cap and the smallest buffer for it.
pub type Decoder = crate::stream::Decoder<Ucp, MAX_LEN>;
