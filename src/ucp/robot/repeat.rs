//! What is sent again and again until the other side has it, and what is sent for ever.

use crate::{
    stats::{count, uncount},
    time::{Duration, Instant},
};

/// Something to be sent at once, and every period until it is dropped.
#[derive(Clone, Debug)]
pub(super) struct Repeat<T> {
    what: Option<Due<T>>,
}

#[derive(Clone, Debug)]
struct Due<T> {
    what: T,
    at: Instant,
    /// How often it has been sent; stops at 2^32 - 1.
    sendings: u32,
}

impl<T: Copy> Repeat<T> {
    pub(super) fn new(what: Option<(T, Instant)>) -> Self {
        Self { what: what.map(|(what, at)| Due { what, at, sendings: 0 }) }
    }

    pub(super) fn begin(&mut self, what: T, now: Instant) {
        self.what = Some(Due { what, at: now, sendings: 0 });
    }

    /// Drops it.
    pub(super) fn end(&mut self) {
        self.what = None;
    }

    /// Is there something that the other side can have received?
    pub(super) fn was_sent(&self) -> bool {
        self.what.as_ref().is_some_and(|due| due.sendings > 0)
    }

    /// What to send now, if anything.
    pub(super) fn take_due(&mut self, now: Instant, period: Duration) -> Option<T> {
        let due = self.what.as_mut().filter(|due| due.at <= now)?;
        due.at = now + period;
        count(&mut due.sendings);
        Some(due.what)
    }

    /// Sends it again at once, if it has not been dropped.
    pub(super) fn again(&mut self, now: Instant) {
        if let Some(due) = &mut self.what {
            due.at = now;
        }
    }

    /// The latest sending did not leave: it does not count, and is due again.
    pub(super) fn take_back(&mut self, now: Instant) {
        if let Some(due) = &mut self.what {
            uncount(&mut due.sendings);
        }
        self.again(now);
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        self.what.as_ref().map(|due| due.at)
    }
}

/// A steady beat: each at one period after the one before, however late that was noticed.
#[derive(Clone, Debug, Default)]
pub(super) struct Cadence {
    next: Option<Instant>,
}

/// One beat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beat {
    /// When the first beat was due that had not been taken.
    due: Instant,
    /// Beats that were missed before this one. They are not made up for.
    pub(super) missed: u32,
}

impl Cadence {
    /// Begins now, unless it has begun.
    pub(super) fn begin(&mut self, now: Instant) {
        self.next.get_or_insert(now);
    }

    /// A beat, if it is time.
    pub(super) fn take_due(&mut self, now: Instant, period: Duration) -> Option<Beat> {
        let due = self.next.filter(|&next| next <= now)?;
        let late = now - due;
        if late == Duration::from_micros(u32::MAX) {
            // More than a Duration can tell: the beat starts anew.
            self.next = Some(now + period);
            let missed = u32::MAX / period.as_micros().max(1);
            return Some(Beat { due, missed });
        }
        let missed = late.as_micros().checked_div(period.as_micros()).unwrap_or(0);
        self.next = Some(due + period.saturating_mul(missed) + period);
        Some(Beat { due, missed })
    }

    /// Takes a beat back: it is due again.
    pub(super) const fn take_back(&mut self, beat: Beat) {
        self.next = Some(beat.due);
    }

    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.next
    }
}
