//! Counts of a line and of its nodes.

use crate::{
    stats::{Latency, count_apart},
    time::Duration,
};

/// What the master has seen of the line as a whole. Counts stop at 2^32 - 1.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MasterStatistics {
    /// WRITE packets sent.
    pub writes: u32,
    /// READ packets sent.
    pub reads: u32,
    /// Bytes dropped because they were received before a request, bytes.
    pub stale_bytes: u32,
    /// Own bytes heard again and removed, bytes.
    pub echo_bytes: u32,
    /// Times that the echo was not what had been sent.
    pub echo_errors: u32,
    /// Times that the dead-man has stopped the nodes.
    pub dead_man: u32,
}

/// The counts of one node. Counts stop at 2^32 - 1.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct NodeStatistics {
    /// Requests that it was to answer.
    pub requests: u32,
    /// Answers in time.
    pub replies: u32,
    /// Windows that closed without its answer, for whatever reason.
    pub timeouts: u32,
    /// Of these, windows in which bytes were heard but no packet: damaged on the way.
    pub crc_errors: u32,
    /// Answers outside their window, or in another node's.
    pub late: u32,
    /// Answers that came before the line could have carried them: left from an older request.
    pub early: u32,
    /// Answers in another mode than the one on record, which put it in doubt (I11).
    pub other_mode: u32,
    /// Requests that repeated one without an answer.
    pub retries: u32,
    /// READs that were given up, all attempts included.
    pub failures: u32,
    /// Times from the end of a request to the beginning of its answer.
    pub latency: Latency,
}

impl NodeStatistics {
    /// As [`default`](Self::default), for constants.
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
