//! What a master keeps of one node.

use super::{MasterConfig, Mode, Polling, Status};
use crate::{
    ikeya::{Board, Target},
    time::{Duration, Instant},
};

/// How a node is (ruling I7).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Health {
    /// It answered the last time.
    Online,
    /// It missed so many answers in a row, 1 or 2.
    Suspect(u8),
    /// It missed three in a row. It is no longer commanded, and asked now and then.
    Abnormal,
}

/// The counts of one node. All wrap.
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
    /// Answers in another mode than the node's, not believed the first time.
    pub other_mode: u32,
    /// Requests that repeated one without an answer.
    pub retries: u32,
    latency_min_us: u32,
    latency_max_us: u32,
    latency_sum_us: u64,
}

impl NodeStatistics {
    /// Shortest time from the end of a request to the beginning of its answer.
    #[must_use]
    pub const fn latency_min(&self) -> Duration {
        Duration::from_micros(self.latency_min_us)
    }

    /// Mean time from the end of a request to the beginning of its answer.
    #[must_use]
    pub const fn latency_mean(&self) -> Duration {
        match self.latency_sum_us.checked_div(self.replies as u64) {
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
        let micros = latency.as_micros();
        let first = self.replies == 0;
        self.latency_min_us = if first { micros } else { self.latency_min_us.min(micros) };
        self.latency_max_us = self.latency_max_us.max(micros);
        self.latency_sum_us = self.latency_sum_us.wrapping_add(micros.into());
        self.replies = self.replies.wrapping_add(1);
    }
}

/// How far the confirmation of a WRITE has come.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Confirm {
    Unasked,
    AfterWrite,
    AfterRead,
}

/// When a node is to be visited.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Due {
    Never,
    Now,
    At(Instant),
}

impl Due {
    pub(super) fn is_reached(self, now: Instant) -> bool {
        match self {
            Self::Never => false,
            Self::Now => true,
            Self::At(at) => now >= at,
        }
    }
}

#[derive(Debug)]
pub(super) struct Node<B: Board> {
    /// `None` until it has answered once.
    pub(super) health: Option<Health>,
    pub(super) mode: Option<Mode>,
    /// The last answer was in the other mode, and was not believed.
    pub(super) other_mode: bool,
    pub(super) target: Option<Target<B>>,
    /// The set-point has not been sent yet.
    pub(super) fresh: bool,
    /// The set-point is a stop, which goes to abnormal nodes too.
    pub(super) is_stop: bool,
    /// A new set-point has been sent out of turn since the last exchange.
    pub(super) jumped: bool,
    /// The set-point has been sent in this cycle.
    pub(super) written: bool,
    pub(super) confirm: Confirm,
    pub(super) status: Option<(Status<B>, Instant)>,
    /// Windows in a row that closed without its answer.
    pub(super) strikes: u8,
    /// Attempts of the READ under way that have failed.
    pub(super) attempt: u8,
    /// A READ has been asked for by hand.
    pub(super) asked: bool,
    /// Not to be asked before then: a late answer may be on its way.
    pub(super) guarded_until: Option<Instant>,
    /// When the next READ is due, with [`Polling::Every`].
    pub(super) read_due: Option<Instant>,
    /// How often it has been asked in the discovery under way.
    pub(super) scans: u8,
    pub(super) statistics: NodeStatistics,
}

impl<B: Board> Node<B> {
    pub(super) fn new() -> Self {
        Self {
            health: None,
            mode: None,
            other_mode: false,
            target: None,
            fresh: false,
            is_stop: false,
            jumped: false,
            written: false,
            confirm: Confirm::Unasked,
            status: None,
            strikes: 0,
            attempt: 0,
            asked: false,
            guarded_until: None,
            read_due: None,
            scans: 0,
            statistics: NodeStatistics {
                requests: 0,
                replies: 0,
                timeouts: 0,
                crc_errors: 0,
                late: 0,
                other_mode: 0,
                retries: 0,
                latency_min_us: 0,
                latency_max_us: 0,
                latency_sum_us: 0,
            },
        }
    }

    pub(super) fn is_online(&self) -> bool {
        matches!(self.health, Some(Health::Online | Health::Suspect(_)))
    }

    pub(super) fn is_abnormal(&self) -> bool {
        self.health == Some(Health::Abnormal)
    }

    /// Takes a new set-point; the latest wins.
    pub(super) fn aim(&mut self, target: Target<B>) {
        (self.target, self.fresh, self.is_stop) = (Some(target), true, false);
    }

    pub(super) fn forget_target(&mut self) {
        (self.target, self.fresh, self.is_stop) = (None, false, false);
    }

    /// The set-point has been sent.
    pub(super) fn sent_target(&mut self) {
        (self.fresh, self.written) = (false, true);
        if self.confirm == Confirm::AfterWrite {
            self.confirm = Confirm::AfterRead;
        }
        if !self.is_online() {
            self.forget_target();
        }
    }

    /// A request that it is to answer has been sent.
    pub(super) fn sent_read(&mut self, config: &MasterConfig, now: Instant) {
        self.statistics.requests = self.statistics.requests.wrapping_add(1);
        if self.attempt > 0 {
            self.statistics.retries = self.statistics.retries.wrapping_add(1);
        }
        (self.written, self.asked) = (false, false);
        if let Polling::Every(period) = config.polling {
            // Without drift, and without a burst after a pause.
            match self.read_due {
                Some(due) if due > now => {}
                Some(due) if due + period > now => self.read_due = Some(due + period),
                _ => self.read_due = Some(now + period),
            }
        }
    }

    /// When it is to be read, or its set-point repeated.
    pub(super) fn due(&self, config: &MasterConfig) -> Due {
        let due = match config.polling {
            _ if !self.is_online() => return Due::Never,
            _ if self.attempt > 0 || self.asked || self.confirm == Confirm::AfterRead => Due::Now,
            Polling::Fastest => Due::Now,
            Polling::Every(_) => self.read_due.map_or(Due::Now, Due::At),
            Polling::Manual => Due::Never,
        };
        self.guarded(due)
    }

    /// When a set-point that has not been sent yet may go.
    pub(super) fn fresh_due(&self) -> Due {
        match (self.fresh, B::ANSWERS_WRITE) {
            (false, _) => Due::Never,
            (true, false) => Due::Now,
            (true, true) => self.askable(),
        }
    }

    /// When it may be asked at all: a late answer of it has to be over.
    pub(super) fn askable(&self) -> Due {
        self.guarded(Due::Now)
    }

    /// Not before the guard is over.
    fn guarded(&self, due: Due) -> Due {
        match (due, self.guarded_until) {
            (Due::Now, Some(until)) => Due::At(until),
            (Due::At(at), Some(until)) => Due::At(at.max(until)),
            (due, _) => due,
        }
    }
}
