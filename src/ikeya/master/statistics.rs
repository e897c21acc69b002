//! Counts of a line and of its nodes.

use crate::{
    stats::{Latency, count_apart},
    time::Duration,
};

/// Counts of the line as a whole. They saturate at 2^32 - 1.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MasterStatistics {
    /// WRITE packets sent.
    pub writes: u32,
    /// READ packets sent.
    pub reads: u32,
    /// Bytes dropped because they were received before a request.
    pub stale_bytes: u32,
    /// Number of times the dead-man has stopped the nodes.
    pub dead_man: u32,
}

/// Counts of one node. They saturate at 2^32 - 1.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct NodeStatistics {
    /// Requests that expected an answer from it.
    pub requests: u32,
    /// Answers in time.
    pub replies: u32,
    /// Windows that closed without its answer, for whatever reason.
    pub timeouts: u32,
    /// Of these, windows in which bytes but no packet were heard: damage on the line.
    pub crc_errors: u32,
    /// Answers outside their window, or in another node's.
    pub late: u32,
    /// Answers too early for the line to have carried them: left over from an older request.
    pub early: u32,
    /// Answers in a mode other than the one on record, which put it in doubt (I11).
    pub other_mode: u32,
    /// Requests repeated for lack of an answer.
    pub retries: u32,
    /// READs given up after all attempts.
    pub failures: u32,
    /// Times from the end of a request to the start of its answer. If the port has kept the
    /// request waiting, that is counted too.
    pub latency: Latency,
}

impl NodeStatistics {
    /// Same as [`default`](Self::default), for constants.
    pub(super) const NEW: Self = Self {
        requests: 0,
        replies: 0,
        timeouts: 0,
        crc_errors: 0,
        late: 0,
        early: 0,
        other_mode: 0,
        retries: 0,
        failures: 0,
        latency: Latency::NEW,
    };

    pub(super) fn reply(&mut self, latency: Duration) {
        count_apart(&mut self.replies);
        self.latency.add(latency);
    }
}
