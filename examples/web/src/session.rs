//! A role that a page drives.

use axlewire::{
    endpoint::{Arrival, Endpoint, Unsent},
    time::{Duration, Instant},
};

/// A turn of the page's loop that comes so late that received bytes may have waited meanwhile.
const LATE: Duration = Duration::from_millis(30);

/// A role, and what it has reported.
pub(crate) struct Session<R: Endpoint> {
    pub(crate) role: R,
    pub(crate) events: Vec<(f64, R::Event)>,
    /// The latest turn of the page's loop.
    turn: Instant,
}

/// The time of the page.
pub(crate) fn instant(now: f64) -> Instant {
    Instant::from_micros((now * 1e3) as u64)
}

/// A span in milliseconds.
pub(crate) fn span(ms: f64) -> Duration {
    Duration::from_micros((ms * 1e3) as u32)
}

impl<R: Endpoint> Session<R> {
    pub(crate) fn new(role: R, now: f64) -> Self {
        Self { role, events: Vec::new(), turn: instant(now) }
    }

    /// Takes in received bytes. If the page was held up, they may have waited.
    pub(crate) fn receive(&mut self, bytes: &[u8], now: f64) {
        let (since, now) = (self.turn, instant(now));
        if now < since + LATE {
            self.role.handle_input(bytes, now);
        } else {
            self.role.handle_input(bytes, Arrival::Between { since, now });
        }
        self.turn = now;
    }

    /// What was due by now happens, such as a dead-man.
    pub(crate) fn catch_up(&mut self, now: f64) {
        let at = instant(now);
        if self.role.poll_timeout().is_some_and(|timeout| timeout <= at) {
            self.role.handle_timeout(at);
        }
        while let Some(event) = self.role.poll_event() {
            self.events.push((now, event));
        }
    }

    /// The next frame to write, if one is due.
    pub(crate) fn transmit(&mut self, now: f64) -> Option<Vec<u8>> {
        self.turn = instant(now);
        self.catch_up(now);
        self.role.poll_transmit(self.turn).map(<[u8]>::to_vec)
    }

    /// A frame was written, or nobody knows how much of it.
    pub(crate) fn sent(&mut self, ok: bool, now: f64) {
        if !ok {
            self.role.handle_transmit(Unsent::CutOff, instant(now));
        }
    }

    /// Milliseconds until the next turn is due, even if nothing is received.
    pub(crate) fn wait(&self, now: f64) -> Option<f64> {
        let at = self.role.poll_timeout()?;
        Some((at.as_micros() as f64 / 1e3 - now).max(0.0))
    }
}
