//! What a master tells: events, refusals, counts.

use core::fmt;

use super::Health;
use crate::ikeya::{Board, Mode, NodeId, OneMotor, Status};

/// What the master tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MasterEvent<B: Board = OneMotor> {
    /// A node has answered for the first time.
    Discovered {
        /// Which.
        node: NodeId,
        /// Its mode.
        mode: Mode,
    },
    /// Every id has been asked.
    DiscoveryDone {
        /// How many nodes are online now.
        online: u8,
    },
    /// A node has answered.
    Status {
        /// Which.
        node: NodeId,
        /// What it measures.
        status: Status<B>,
    },
    /// A READ was given up.
    ReadFailed {
        /// Which node did not answer.
        node: NodeId,
        /// What was heard instead, the last time.
        cause: Cause,
    },
    /// A node's health has changed.
    Health {
        /// Which.
        node: NodeId,
        /// To what.
        health: Health,
    },
    /// A node answers in another mode than before; its set-point is dropped.
    ModeChanged {
        /// Which.
        node: NodeId,
        /// The new mode.
        mode: Mode,
    },
    /// A node has answered a READ that followed the WRITE to be confirmed.
    Confirmed {
        /// Which.
        node: NodeId,
    },
    /// The READ that was to confirm a WRITE failed.
    NotConfirmed {
        /// Which node.
        node: NodeId,
        /// What was heard instead.
        cause: Cause,
    },
}

/// Why a window closed without its answer.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause {
    /// Nothing was heard.
    Silent,
    /// Bytes were heard, but no packet: damaged, or noise.
    Damaged,
    /// Only other nodes were heard, or the node in another mode.
    Unexpected,
}

/// Why a command is refused.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CommandError {
    /// The node has not been discovered, or is abnormal.
    NotOnline {
        /// Which.
        node: NodeId,
    },
    /// The node is in the other mode (ruling I3).
    WrongMode {
        /// Which.
        node: NodeId,
        /// The mode it is in.
        mode: Mode,
    },
    /// The node has not told a position yet that could be held (ruling I6).
    NoPosition {
        /// Which.
        node: NodeId,
    },
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotOnline { node } => write!(f, "node {node} is not online"),
            Self::WrongMode { node, mode } => write!(f, "node {node} is in {mode} mode"),
            Self::NoPosition { node } => write!(f, "node {node} has not told its position"),
        }
    }
}

impl core::error::Error for CommandError {}

/// What the master has seen of the line as a whole.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MasterStatistics {
    /// WRITE packets sent.
    pub writes: u32,
    /// READ packets sent.
    pub reads: u32,
    /// Bytes dropped because they stood on the line before a request, bytes.
    pub stale_bytes: u32,
    /// Own bytes heard again and removed, bytes.
    pub echo_bytes: u32,
    /// Times that the echo was not what had been sent.
    pub echo_errors: u32,
    /// Events refused because nobody took the older ones.
    pub lost_events: u32,
}
