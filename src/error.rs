//! Errors: one type per operation, with the values that explain it.
//!
//! Bad bytes on a line are not errors: the decoder counts them (see [`stream`](crate::stream)).
//! These types are for code that parses or builds single packets.

use core::{error::Error, fmt};

/// Why bytes are not the packet that they were parsed as.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ParseError {
    /// The slice has the wrong length.
    Length {
        /// Length of the packet, bytes.
        expected: usize,
        /// Length of the slice, bytes.
        found: usize,
    },
    /// The header or the node id has a value that this packet cannot have.
    Field,
    /// The bytes are damaged: the CRC does not match them (ruling B1).
    Crc {
        /// CRC of the bytes before the CRC field.
        expected: u16,
        /// Value of the CRC field.
        found: u16,
    },
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { expected, found } => {
                write!(f, "packet has {expected} bytes, but slice has {found}")
            }
            Self::Field => f.write_str("header or node id does not belong to this packet"),
            Self::Crc { expected, found } => {
                write!(f, "CRC is {expected:#06x}, but packet has {found:#06x}")
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
        /// The invalid value.
        value: u8,
    },
    /// DIP switches that select no node: more than four digits, or id digits 000 in a reading
    /// without a node 0 (ruling I2).
    DipSwitch {
        /// The switches, one bit each.
        bits: u8,
    },
    /// NaN or infinity, where a motor needs a finite number (ruling I4).
    NotFinite {
        /// The invalid value.
        value: f64,
    },
    /// A position outside the range of count and rotation (ruling I5).
    Position {
        /// The invalid value, counts; saturated to `i64` for a huge number of turns.
        counts: i64,
        /// Smallest position that can be sent, counts.
        min: i32,
        /// Largest position that can be sent, counts.
        max: i32,
    },
    /// A speed or turn outside its range: -100..=100 or a part of it (rulings U6, U7).
    Percent {
        /// The invalid value.
        value: i16,
        /// Smallest value that can be sent.
        min: i16,
        /// Largest value that can be sent.
        max: i16,
    },
    /// A network state above 255: it does not fit into one byte (ruling U8).
    NetworkState {
        /// The invalid value.
        value: u32,
    },
    /// The buffer is too small for the frame.
    BufferTooSmall {
        /// Length of the frame, bytes.
        needed: usize,
        /// Length of the buffer, bytes.
        available: usize,
    },
    /// A body that makes `len` larger than shipped robots can handle (rulings U2, U13).
    BodyTooLong {
        /// Length of the body, bytes.
        length: usize,
        /// Longest body that can be sent, bytes.
        limit: usize,
    },
    /// A raw frame with the id of a known message. Send it by its own type, which cannot be too
    /// short or start an update by accident (rulings U7, U13).
    KnownId {
        /// The id.
        id: u8,
    },
    /// A raw frame with FD FF behind its header. Shipped robots give up a frame at an id that they
    /// do not know, and would take what follows there for a frame (ruling U13).
    NestedHeader {
        /// Offset of the FD in the frame, bytes.
        at: usize,
    },
    /// A motor command whose version field starts a firmware update in shipped robots (rulings U7,
    /// U13).
    StartsUpdate {
        /// Its version field.
        version: u16,
    },
    /// A frame, cast from bytes, whose header does not match its body (ruling U13).
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
            Self::DipSwitch { bits } => write!(f, "DIP switches {bits:#06b} select no node"),
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
                write!(f, "id {id:#04x} has its own message type and cannot be sent raw")
            }
            Self::NestedHeader { at } => {
                write!(f, "FD FF at byte {at}: shipped robots would take it for another frame")
            }
            Self::StartsUpdate { version } => {
                write!(f, "motor command with version {version} would start a firmware update")
            }
            Self::Header { id, len } => {
                write!(f, "header (id {id:#04x}, length {len}) does not match its body")
            }
        }
    }
}

impl Error for EncodeError {}
