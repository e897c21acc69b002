//! Events of a master, and its refusals.

use core::fmt;

use super::health::Health;
use crate::ikeya::{
    board::{Board, OneMotor, Status},
    units::{Mode, NodeId},
};

/// What the master tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// A node has answered twice in another mode than before; its set-point is dropped (I11).
    ModeChanged {
        /// Which.
        node: NodeId,
        /// The new mode.
        mode: Mode,
    },
    /// The mode of a node is in doubt, and six exchanges have not decided it (I11). It is read at the
    /// pace of the search from now on.
    ModeInDoubt {
        /// Which.
        node: NodeId,
    },
    /// The same of a node that is owed a stop: it cannot be written before the mode is known. **The
    /// motor may be running.**
    StopBlocked {
        /// Which.
        node: NodeId,
    },
    /// A stop is paid: two stop WRITEs have each been followed by an answer of the node (I12). The
    /// motor may still be running out.
    Stopped {
        /// Which.
        node: NodeId,
    },
    /// A node whose stop is paid was measured standing still: below 0.05 rps, or within 8 counts in
    /// 20 ms or more (I12).
    StandingStill {
        /// Which.
        node: NodeId,
    },
    /// The application has given no sign of life for [`MasterConfig::dead_man`](super::MasterConfig::dead_man):
    /// every node under a set-point is owed a stop (I13).
    DeadMan,
    /// A node has answered a READ that followed the WRITE to be confirmed.
    Confirmed {
        /// Which.
        node: NodeId,
    },
    /// The READ that was to confirm a WRITE failed, or the set-point was dropped before.
    NotConfirmed {
        /// Which node.
        node: NodeId,
        /// What was heard instead.
        cause: Cause,
    },
}

/// Why there is no answer, or no confirmation.
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
    /// The set-point to be confirmed was dropped: released, stopped, or meant for another mode.
    Dropped,
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
    /// An answer has put the node's mode in doubt (ruling I11). Try again after the next one.
    ModeInDoubt {
        /// Which.
        node: NodeId,
    },
    /// The node is owed a stop (ruling I12). Wait for [`MasterEvent::Stopped`].
    StopOwed {
        /// Which.
        node: NodeId,
    },
    /// The node has no set-point that could be confirmed.
    NoSetPoint {
        /// Which.
        node: NodeId,
    },
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotOnline { node } => write!(f, "node {node} is not online"),
            Self::WrongMode { node, mode } => write!(f, "node {node} is in {mode} mode"),
            Self::ModeInDoubt { node } => write!(f, "the mode of node {node} is in doubt"),
            Self::StopOwed { node } => write!(f, "node {node} has not confirmed its stop yet"),
            Self::NoSetPoint { node } => write!(f, "node {node} has no set-point"),
        }
    }
}

impl core::error::Error for CommandError {}
