//! Counts of a slave.

/// Packets heard and answers sent by a slave. Counts saturate at 2^32 - 1.
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
    /// Requests not answered because more bytes arrived before the answer was sent.
    pub overtaken: u32,
    /// Requests not answered because the answer was not sent in time.
    pub expired: u32,
    /// Answers of other nodes, on two wires; and its own if it hears them.
    pub answers: u32,
    /// Number of times the watchdog has fired.
    pub watchdog: u32,
}
