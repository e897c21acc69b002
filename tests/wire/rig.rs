//! Packets made by hand, which the library itself might refuse to build.
#![allow(dead_code, unused_imports, reason = "each protocol uses a part")]

/// What the tests of packets and messages use of the library.
#[cfg(feature = "ikeya")]
pub(crate) use axlewire::ikeya::{
    BothDirections, Mode, NodeId, Packet, Position, PositionResponse, ReadRequest, Request,
    Response, Rps, VelocityResponse, WriteRequest, three,
};
#[cfg(feature = "ucp")]
pub(crate) use axlewire::ucp::{
    Body, Frame, FrameOf, Message, MotorControl, RawFrame, Telemetry, Ucp, message::*,
};
pub(crate) use axlewire::{
    encode::Encode,
    error::{EncodeError, ParseError},
    stream::{Counters, Event, Frames, Framing, Gap, Reason},
    time::{Duration, Instant},
};

/// These bytes with their CRC.
pub(crate) fn sealed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &axlewire::crc16::compute(bytes).to_le_bytes()].concat()
}

/// A UCP frame with any id and any body.
pub(crate) fn frame(id: u8, index: u8, body: &[u8]) -> Vec<u8> {
    let [low, high] = (body.len() as u16 + 4).to_le_bytes();
    sealed(&[&[0xFD, 0xFF, low, high, id, index], body].concat())
}

/// Bytes in hex, as in JSON.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
