//! Errors, one type per operation, each with the values that explain it.
//!
//! Bad bytes on a line are not errors: the decoder counts them (see [`stream`](crate::stream)).
//! These types answer a caller who parses or builds one packet by hand.

use core::{error::Error, fmt};

/// Why some bytes are not the packet they were parsed as.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ParseError {
    /// The slice is not as long as the packet, bytes.
    Length {
        /// Length of the packet.
        expected: usize,
        /// Length of the slice.
        found: usize,
    },
    /// The header or the node id has a value that this packet cannot have.
    Field,
    /// The bytes were damaged: the CRC does not belong to them (ruling B1).
    Crc {
        /// CRC of the bytes in front of the CRC field.
        expected: u16,
        /// CRC field.
        found: u16,
    },
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { expected, found } => {
                write!(f, "packet has {expected} bytes, {found} were given")
            }
            Self::Field => f.write_str("header or node id is not one of this packet"),
            Self::Crc { expected, found } => {
                write!(f, "CRC is {expected:#06x}, packet says {found:#06x}")
            }
        }
    }
}

impl Error for ParseError {}

/// Why a value or a frame cannot be sent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EncodeError {
    /// A node id outside 1..=8 (ruling I1).
    NodeId {
        /// What was given.
        value: u8,
    },
    /// DIP switches that name no node: more than four digits, or id digits 000 under a reading
    /// that has no node 0 (ruling I2).
    DipSwitch {
        /// What was given, one bit per switch.
        bits: u8,
    },
    /// A NaN or an infinity where a motor needs a number (ruling I4).
    NotFinite {
        /// What was given.
        value: f64,
    },
    /// A position beyond what count and rotation can carry (ruling I5).
    Position {
        /// What was given, counts; saturated to `i64` when it was a huge number of turns.
        counts: i64,
        /// Smallest position that can be sent, counts.
        min: i32,
        /// Largest position that can be sent, counts.
        max: i32,
    },
    /// A speed or turn outside its range, which is -100..=100 or a part of it (rulings U6, U7).
    Percent {
        /// What was given.
        value: i16,
        /// Smallest value that can be sent.
        min: i16,
        /// Largest value that can be sent.
        max: i16,
    },
    /// A network state above 255, which one byte cannot carry (ruling U8).
    NetworkState {
        /// What was given.
        value: u32,
    },
    /// The caller's buffer cannot hold the frame.
    BufferTooSmall {
        /// Bytes that the frame needs.
        needed: usize,
        /// Bytes that the buffer has.
        available: usize,
    },
    /// A body that would make `len` larger than any shipped robot survives (rulings U2, U13).
    BodyTooLong {
        /// Length of the body, bytes.
        length: usize,
        /// Longest body that can be sent, bytes.
        limit: usize,
    },
    /// A raw frame with the id of a known message: those are sent by their own types, which
    /// cannot be too short or start an update by accident (rulings U7, U13).
    KnownId {
        /// The id.
        id: u8,
    },
    /// A motor command whose version field starts a firmware update in shipped robots (rulings U7,
    /// U13).
    StartsUpdate {
        /// Its version field.
        version: u16,
    },
    /// A frame, cast from bytes, whose header does not belong to its body (ruling U13).
    Header {
        /// Id in its header.
        id: u8,
        /// Length field of its header.
        len: u16,
    },
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NodeId { value } => write!(f, "node id {value} is outside 1..=8"),
            Self::DipSwitch { bits } => write!(f, "DIP switches {bits:#06b} name no node"),
            Self::NotFinite { value } => write!(f, "{value} is not a finite number"),
            Self::Position { counts, min, max } => {
                write!(f, "position of {counts} counts is outside {min}..={max}")
            }
            Self::Percent { value, min, max } => write!(f, "{value} is outside {min}..={max}"),
            Self::NetworkState { value } => {
                write!(f, "network state {value} does not fit into one byte")
            }
            Self::BufferTooSmall { needed, available } => {
                write!(f, "frame needs {needed} bytes, buffer has {available}")
            }
            Self::BodyTooLong { length, limit } => {
                write!(f, "body of {length} bytes is longer than {limit}")
            }
            Self::KnownId { id } => {
                write!(f, "id {id:#04x} has a message type of its own and is not sent raw")
            }
            Self::StartsUpdate { version } => {
                write!(f, "motor command with version {version} would start a firmware update")
            }
            Self::Header { id, len } => {
                write!(f, "header with id {id:#04x} and length {len} is not that of its body")
            }
        }
    }
}

impl Error for EncodeError {}
