//! What is sent again and again until the other side has it, and what is sent for ever.

use crate::time::{Duration, Instant};

/// Something to be sent at once, and every period until it is dropped.
#[derive(Debug)]
pub(super) struct Repeat<T> {
    what: Option<(T, Instant)>,
}

impl<T: Copy> Repeat<T> {
    pub(super) const fn new(what: Option<(T, Instant)>) -> Self {
        Self { what }
    }

    pub(super) const fn begin(&mut self, what: T, now: Instant) {
        self.what = Some((what, now));
    }

    /// Drops it; says whether there was something to drop.
    pub(super) const fn end(&mut self) -> bool {
        self.what.take().is_some()
    }

    /// What to send now, if anything.
    pub(super) fn take(&mut self, now: Instant, period: Duration) -> Option<T> {
        let (what, at) = self.what.as_mut()?;
        if *at > now {
            return None;
        }
        *at = now + period;
        Some(*what)
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        self.what.as_ref().map(|(_, at)| *at)
    }
}

/// A steady beat: each at one period after the one before, however late that was noticed.
#[derive(Debug, Default)]
pub(super) struct Cadence {
    next: Option<Instant>,
}

impl Cadence {
    /// Begins now, unless it has begun.
    pub(super) fn begin(&mut self, now: Instant) {
        self.next.get_or_insert(now);
    }

    /// If it is time, how many beats were missed before this one. They are not made up for.
    pub(super) fn take(&mut self, now: Instant, period: Duration) -> Option<u32> {
        let next = self.next.filter(|&next| next <= now)?;
        let late = now - next;
        if late == Duration::from_micros(u32::MAX) {
            // More than a Duration can tell: the beat starts anew.
            self.next = Some(now + period);
            return Some(u32::MAX / period.as_micros().max(1));
        }
        let missed = late.as_micros().checked_div(period.as_micros()).unwrap_or(0);
        self.next = Some(next + period.saturating_mul(missed) + period);
        Some(missed)
    }

    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.next
    }
}
