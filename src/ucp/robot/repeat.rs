//! Frames repeated until the other side has them, and frames repeated forever.

use crate::{
    stats::{count, uncount},
    time::{Duration, Instant},
};

/// Something to be sent at once, and then every period until it is dropped.
#[derive(Clone, Debug)]
pub(super) struct Repeat<T> {
    what: Option<Due<T>>,
}

#[derive(Clone, Debug)]
struct Due<T> {
    what: T,
    at: Instant,
    /// Number of times it has been sent; saturates at 2^32 - 1.
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

    /// Whether it has been sent, so that the other side may have received it.
    pub(super) fn was_sent(&self) -> bool {
        self.what.as_ref().is_some_and(|due| due.sendings > 0)
    }

    /// The item to send now, if any.
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

    /// Takes back the latest sending, which did not leave: it does not count, and is due again.
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

/// A steady beat: each is due one period after the previous one, however late that was noticed.
#[derive(Clone, Debug, Default)]
pub(super) struct Cadence {
    next: Option<Instant>,
}

/// One beat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beat {
    /// Time at which the first beat not taken was due.
    due: Instant,
    /// Number of beats missed before this one. They are not made up for.
    pub(super) missed: u32,
}

impl Cadence {
    /// Begins now, unless it has already begun.
    pub(super) fn begin(&mut self, now: Instant) {
        self.next.get_or_insert(now);
    }

    /// A beat, if one is due.
    pub(super) fn take_due(&mut self, now: Instant, period: Duration) -> Option<Beat> {
        let due = self.next.filter(|&next| next <= now)?;
        let late = now - due;
        if late == Duration::from_micros(u32::MAX) {
            // More than a Duration can hold: restart the beat.
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
