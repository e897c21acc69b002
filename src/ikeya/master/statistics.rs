//! Counts of a line and of its nodes.

use crate::time::Duration;

/// What the master has seen of the line as a whole. All counts wrap.
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

/// The counts of one node. All wrap, but those of the latency, which stop together.
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
    latency_count: u32,
    latency_min_us: u32,
    latency_max_us: u32,
    latency_sum_us: u64,
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
        latency_count: 0,
        latency_min_us: 0,
        latency_max_us: 0,
        latency_sum_us: 0,
    };

    /// Shortest time from the end of a request to the beginning of its answer.
    #[must_use]
    pub const fn latency_min(&self) -> Duration {
        Duration::from_micros(self.latency_min_us)
    }

    /// Mean time from the end of a request to the beginning of its answer, over the first 2^32
    /// answers.
    #[must_use]
    pub const fn latency_mean(&self) -> Duration {
        match self.latency_sum_us.checked_div(self.latency_count as u64) {
            Some(mean) => Duration::from_micros(mean as u32),
            None => Duration::ZERO,
        }
    }

    /// Longest time from the end of a request to the beginning of its answer.
    #[must_use]
    pub const fn latency_max(&self) -> Duration {
        Duration::from_micros(self.latency_max_us)
    }

    pub(super) fn reply(&mut self, latency: Duration) {
        self.replies = self.replies.wrapping_add(1);
        let micros = latency.as_micros();
        let is_first = self.latency_count == 0;
        self.latency_min_us = if is_first { micros } else { self.latency_min_us.min(micros) };
        self.latency_max_us = self.latency_max_us.max(micros);
        // 2^32 spans of 32 bits fit into 64; one more would let the mean drift.
        if let Some(count) = self.latency_count.checked_add(1) {
            self.latency_count = count;
            self.latency_sum_us += u64::from(micros);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_latency_stays_right_when_the_count_of_replies_wraps() {
        let mut statistics = NodeStatistics {
            replies: u32::MAX,
            latency_count: u32::MAX,
            latency_sum_us: u64::from(u32::MAX) * 50,
            ..NodeStatistics::NEW
        };
        for _ in 0..3 {
            statistics.reply(Duration::from_micros(50));
        }
        assert_eq!(statistics.replies, 2);
        assert_eq!(statistics.latency_mean(), Duration::from_micros(50));
    }
}
