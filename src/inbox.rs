//! When received bytes arrived, and when the line is idle. For every role that waits for the other
//! end to speak first.

use crate::time::{Duration, Instant, reached};

/// Times of the newest received bytes.
#[derive(Clone, Debug)]
pub(crate) struct Inbox {
    /// Earliest time at which the newest byte may have arrived.
    last: Instant,
    /// When that byte was handed in: the rest of its frame may arrive from then on.
    read_at: Instant,
    /// Length of a pause that cuts a frame off.
    idle: Duration,
    after_idle: AfterIdle,
}

/// What an idle line means for the candidates behind the one it ends.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum AfterIdle {
    /// They end as well.
    #[cfg(feature = "ucp")]
    GiveUpAll,
    /// Each waits for as long again.
    #[cfg(feature = "ikeya")]
    WaitAgain,
}

impl Inbox {
    pub(crate) const fn new(idle: Duration, after_idle: AfterIdle, now: Instant) -> Self {
        Self { last: now, read_at: now, idle, after_idle }
    }

    /// Notes bytes handed in at `now` that may have arrived at any time from `at` on.
    pub(crate) const fn receive(&mut self, at: Instant, now: Instant) {
        (self.last, self.read_at) = (at, now);
    }

    /// Whether the line has been idle for long enough that nothing will complete the `pending`
    /// bytes (ruling B3).
    ///
    /// If it has, call the decoder's `idle`, take the frames that the candidate held back, and call
    /// this again.
    pub(crate) fn settle(&mut self, pending: usize, now: Instant) -> bool {
        let is_idle = reached(self.deadline(pending), now);
        if is_idle {
            match self.after_idle {
                #[cfg(feature = "ucp")]
                AfterIdle::GiveUpAll => {}
                #[cfg(feature = "ikeya")]
                AfterIdle::WaitAgain => self.read_at = now,
            }
        }
        is_idle
    }

    /// Earliest time at which the newest byte may have arrived.
    pub(crate) const fn last(&self) -> Instant {
        self.last
    }

    /// When the line counts as idle, if any bytes are pending.
    pub(crate) fn deadline(&self, pending: usize) -> Option<Instant> {
        (pending > 0).then(|| self.read_at + self.idle)
    }
}
