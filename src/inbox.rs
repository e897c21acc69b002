//! When received bytes arrived, and when the line is idle: the inbox of every role that waits for
//! the other end to speak first.

use crate::time::{Duration, Instant, reached};

/// The times of the newest bytes that a role has received.
#[derive(Clone, Debug)]
pub(crate) struct Inbox {
    /// Earliest time at which the newest byte can have arrived.
    last: Instant,
    /// When that byte was handed in: the rest of its frame may come from then on.
    read_at: Instant,
    /// A pause this long cuts a frame off.
    idle: Duration,
    after_idle: AfterIdle,
}

/// What an idle line means for the candidates behind the one that it has ended.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum AfterIdle {
    /// They end with it.
    #[cfg(feature = "ucp")]
    GiveUpAll,
    /// Each may go on for as long again.
    #[cfg(feature = "ikeya")]
    WaitAgain,
}

impl Inbox {
    pub(crate) const fn new(idle: Duration, after_idle: AfterIdle, now: Instant) -> Self {
        Self { last: now, read_at: now, idle, after_idle }
    }

    /// Bytes are handed in at `now`, and may have arrived at any time from `at` on.
    pub(crate) const fn receive(&mut self, at: Instant, now: Instant) {
        (self.last, self.read_at) = (at, now);
    }

    /// Has the line been idle for so long that nothing will complete the `pending` bytes (ruling B3)?
    ///
    /// If it has, call `idle` of the decoder and take the frames that the candidate has held back,
    /// and then ask again.
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

    /// When the newest byte had arrived, at the earliest.
    pub(crate) const fn last(&self) -> Instant {
        self.last
    }

    /// When the line counts as idle, if any byte is pending.
    pub(crate) fn deadline(&self, pending: usize) -> Option<Instant> {
        (pending > 0).then(|| self.read_at + self.idle)
    }
}
