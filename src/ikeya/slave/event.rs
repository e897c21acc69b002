//! Events of a slave, and its counts.

use crate::ikeya::{Board, OneMotor, Target};

/// What the slave tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SlaveEvent<B: Board = OneMotor> {
    /// A command for this node, in its mode. Repeated as often as the master repeats it.
    Command(Target<B>),
    /// No command for [`SlaveConfig::watchdog`](super::SlaveConfig::watchdog): stop what moves.
    Watchdog,
}

/// What a slave has heard. All counts wrap.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct SlaveStatistics {
    /// READ packets for this node.
    pub reads: u32,
    /// WRITE packets for this node.
    pub writes: u32,
    /// Of these, rejected: NaN or infinite speed (ruling I4).
    pub refused: u32,
    /// Packets for other nodes.
    pub foreign: u32,
    /// Answers sent.
    pub replies: u32,
    /// Requests not answered, because more bytes were received before the answer was sent.
    pub overtaken: u32,
    /// Requests not answered, because the answer was not sent in time.
    pub expired: u32,
    /// Answers of other nodes, on two wires; one's own as well where it is heard.
    pub answers: u32,
    /// Events that nobody had taken when the next one replaced them.
    pub lost_events: u32,
}
