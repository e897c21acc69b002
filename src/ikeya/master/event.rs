//! Events and command errors of a master, and the health of its nodes.

use core::fmt;

use crate::ikeya::{
    board::{Board, OneMotor, Status},
    units::{Mode, NodeId},
};

/// An event of a master.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MasterEvent<B: Board = OneMotor> {
    /// A node has answered for the first time.
    Discovered {
        /// The node.
        node: NodeId,
        /// Its mode.
        mode: Mode,
    },
    /// Every id has been polled: the discovery is over.
    DiscoveryDone {
        /// Number of online nodes.
        online: u8,
    },
    /// A node has answered.
    Status {
        /// The node.
        node: NodeId,
        /// Its status.
        status: Status<B>,
    },
    /// A READ was given up after its last attempt.
    ReadFailed {
        /// The node that did not answer.
        node: NodeId,
        /// What was heard instead on the last attempt.
        cause: Cause,
    },
    /// A node's health has changed.
    Health {
        /// The node.
        node: NodeId,
        /// Its new health.
        health: Health,
    },
    /// A node has answered twice in a mode other than the one on record; its set-point is dropped
    /// (I11).
    ModeChanged {
        /// The node.
        node: NodeId,
        /// The new mode.
        mode: Mode,
    },
    /// The mode of a node is still in doubt after six exchanges (I11). It is read at the search
    /// rate from now on.
    ModeInDoubt {
        /// The node.
        node: NodeId,
    },
    /// Like [`ModeInDoubt`](Self::ModeInDoubt), but for a node that is owed a stop: nothing is
    /// written before the mode is known. **The motor may be running.**
    StopBlocked {
        /// The node.
        node: NodeId,
    },
    /// A stop is confirmed: two stop WRITEs have each been followed by an answer from the node
    /// (I12). Set-points are accepted again. The motor may still be slowing down, or not even have
    /// heard the stop, which is repeated until [`StandingStill`](Self::StandingStill).
    Stopped {
        /// The node.
        node: NodeId,
    },
    /// The motor is seen to be still after a stop: two answers at least 20 ms apart show less than
    /// 0.05 rps, or three show positions within 8 counts of the one before (I12).
    StandingStill {
        /// The node.
        node: NodeId,
    },
    /// The stop of a node is confirmed, but its motor still moves after
    /// [`MasterConfig::coast`](super::MasterConfig::coast) (I12). Told once; the stop is repeated.
    StillMoving {
        /// The node.
        node: NodeId,
        /// Its last status.
        status: Status<B>,
    },
    /// The application has shown no sign of life for
    /// [`MasterConfig::dead_man`](super::MasterConfig::dead_man): every node under a set-point is
    /// owed a stop (I13).
    DeadMan,
    /// A node has answered a READ that followed the WRITE to be confirmed.
    Confirmed {
        /// The node.
        node: NodeId,
    },
    /// The READ that should confirm a WRITE failed, or the set-point was dropped first.
    NotConfirmed {
        /// The node.
        node: NodeId,
        /// What was heard instead.
        cause: Cause,
    },
}

/// Reason for a missing answer or confirmation.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause {
    /// Nothing was heard.
    Silent,
    /// Bytes were heard, but no valid packet: damage or noise.
    Damaged,
    /// Only other nodes were heard, or the node in another mode, too early or too late, or bytes
    /// that may be older than the request.
    Unexpected,
    /// The set-point to be confirmed was dropped: released, stopped, or meant for another mode.
    Dropped,
}

/// Reason for refusing a command.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CommandError {
    /// The node has not been discovered, or is abnormal.
    NotOnline {
        /// The node.
        node: NodeId,
    },
    /// The node is in the other mode (ruling I3).
    WrongMode {
        /// The node.
        node: NodeId,
        /// The mode that it is in.
        mode: Mode,
    },
    /// An answer has put the node's mode in doubt (ruling I11). Try again after the next answer.
    ModeInDoubt {
        /// The node.
        node: NodeId,
    },
    /// The node is owed a stop (ruling I12). Wait for [`MasterEvent::Stopped`].
    StopOwed {
        /// The node.
        node: NodeId,
    },
    /// The node has no set-point to confirm.
    NoSetPoint {
        /// The node.
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

/// Health of a node (ruling I7).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Health {
    /// It answered its last request.
    Online,
    /// It missed this many answers in a row, 1 or 2.
    Suspect(u8),
    /// It missed three in a row. It gets no set-points, and is polled only occasionally.
    Abnormal,
}

impl Health {
    /// Whether the node is believed to answer, that is, not abnormal.
    #[must_use]
    pub const fn is_online(self) -> bool {
        !matches!(self, Self::Abnormal)
    }
}

/// A change that a node reports to its role, which tells the application.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// Its mode stays in doubt.
    Undecided,
    /// It has answered for the first time.
    Discovered,
    /// Its health is another one.
    Health,
    /// A READ was given up.
    Failed,
    /// Its confirmation was given up with that READ.
    Unconfirmed,
    /// Its confirmation was given up with its set-point.
    Dropped,
    /// It has answered in another mode again.
    Mode,
    /// It has answered in its mode.
    Answered,
    /// The WRITE to be confirmed was followed by an answer.
    Confirmed,
    /// Its stop is confirmed.
    Stopped,
    /// It is seen to be still.
    Still,
    /// It moves although its stop was confirmed long ago.
    StillMoving,
}

impl Change {
    /// All of them, in the order in which they are told.
    pub(super) const ALL: [Self; 12] = [
        Self::Undecided,
        Self::Discovered,
        Self::Health,
        Self::Failed,
        Self::Unconfirmed,
        Self::Dropped,
        Self::Mode,
        Self::Answered,
        Self::Confirmed,
        Self::Stopped,
        Self::Still,
        Self::StillMoving,
    ];
}

/// The changes of a node in one step, one bit each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Changes(u16);

impl Changes {
    pub(super) const NONE: Self = Self(0);

    /// These, and one more if it `has_happened`.
    pub(super) fn with(self, change: Change, has_happened: bool) -> Self {
        Self(self.0 | u16::from(has_happened) << change as u16)
    }

    pub(super) const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    pub(super) const fn has(self, change: Change) -> bool {
        self.0 >> change as u16 & 1 != 0
    }
}
