//! Since when bytes may have waited in the port.

use crate::{
    endpoint::Arrival,
    time::{Duration, Instant},
};

/// The looks at a port for received bytes.
#[derive(Clone, Debug)]
pub(super) struct Looks {
    /// The latest one.
    pub(super) latest: Instant,
    /// The latest that found the port empty: all received bytes have arrived since.
    pub(super) empty_at: Instant,
    /// The first one since that did not, but ended in an error or at its limit.
    pub(super) unsure_since: Option<Instant>,
    /// A frame was handed out although bytes may have waited, by this driver or by one before it:
    /// up to the next empty port, what is received may be from before that frame.
    has_overtaken: bool,
}

impl Looks {
    /// A port that was not looked at yet; since `empty_at`, as far as is known.
    pub(super) const fn new(now: Instant, empty_at: Instant) -> Self {
        Self { latest: now, empty_at, unsure_since: Some(now), has_overtaken: true }
    }

    /// The port is another one, or may have received anything.
    pub(super) fn forget(&mut self, now: Instant) {
        *self = Self { latest: self.latest, ..Self::new(now, long_before(now)) };
    }

    /// A look begins at this time or a little later.
    pub(super) fn begin(&mut self, now: Instant) {
        self.latest = now;
        self.unsure_since.get_or_insert(now);
    }

    /// It found the port empty. A short read does not show that: a ring buffer returns only the
    /// bytes up to its end.
    pub(super) fn saw_empty(&mut self, now: Instant) {
        self.empty_at = now;
        (self.unsure_since, self.has_overtaken) = (None, false);
    }

    /// A frame is handed out.
    pub(super) fn note_frame(&mut self) {
        self.has_overtaken |= self.unsure_since.is_some();
    }

    /// When bytes have arrived that are read now. If the port was not seen empty recently, the
    /// driver was held up, in a call of the port, by its caller or by another task, and they may
    /// have arrived at any time since it was. So they may if a frame has been sent past them.
    pub(super) fn arrived(&self, now: Instant, held_up_after: Option<Duration>) -> Arrival {
        let is_old = match held_up_after {
            Some(limit) => now - self.empty_at > limit,
            None => self.has_overtaken,
        };
        match is_old {
            true => self.since_empty(now),
            false => Arrival::Now(now),
        }
    }

    /// At any time since the port was seen empty.
    pub(super) const fn since_empty(&self, now: Instant) -> Arrival {
        Arrival::Between { since: self.empty_at, now }
    }
}

/// When the bytes in a port may have arrived that was not looked at before.
pub(super) fn long_before(now: Instant) -> Instant {
    const HOUR_US: u64 = 3_600_000_000;
    Instant::from_micros(now.as_micros().wrapping_sub(HOUR_US))
}
