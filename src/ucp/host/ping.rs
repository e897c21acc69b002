//! Pings, one at a time: a pong does not say which ping it answers.

use super::config::HostConfig;
use crate::time::{Duration, Instant};

/// State of the current ping.
#[derive(Clone, Copy, Debug)]
pub(super) enum PingState {
    /// Pings are disabled.
    Off,
    /// To be sent at this time.
    Due(Instant),
    /// Sent at `at`, and lost if no pong arrives before `until`.
    Sent { at: Instant, until: Instant },
}

impl PingState {
    pub(super) fn new(now: Instant, config: &HostConfig) -> Self {
        if config.ping_period.is_some() { Self::Due(now) } else { Self::Off }
    }

    /// Whether a ping is to be sent now; if so, it counts as sent.
    pub(super) fn take_due(&mut self, now: Instant, config: &HostConfig) -> bool {
        let due = matches!(*self, Self::Due(at) if at <= now);
        if due {
            *self = Self::Sent { at: now, until: now + config.ping_timeout };
        }
        due
    }

    /// Handles a pong; returns its round trip, if one was expected.
    pub(super) fn pong(&mut self, now: Instant, config: &HostConfig) -> Option<Duration> {
        let Self::Sent { at, .. } = *self else { return None };
        self.next(at, now, config);
        Some(now - at)
    }

    /// Gives up a ping whose pong is late; returns whether it did.
    pub(super) fn expire(&mut self, now: Instant, config: &HostConfig) -> bool {
        let Self::Sent { at, until } = *self else { return false };
        let late = until <= now;
        if late {
            self.next(at, now, config);
        }
        late
    }

    /// Takes back a ping that did not reach the line: it is due again. `false` if it has already
    /// been given up.
    pub(super) fn unsent(&mut self, now: Instant) -> bool {
        let sent = matches!(self, Self::Sent { .. });
        if sent {
            *self = Self::Due(now);
        }
        sent
    }

    /// Ends a silence: a ping that was due during it is due now.
    pub(super) fn resume(&mut self, now: Instant) {
        if let Self::Due(at) = self {
            *at = now.max(*at);
        }
    }

    pub(super) const fn deadline(&self) -> Option<Instant> {
        match *self {
            Self::Off => None,
            Self::Due(at) | Self::Sent { until: at, .. } => Some(at),
        }
    }

    /// Finishes the ping sent at `sent`, and schedules the next.
    fn next(&mut self, sent: Instant, now: Instant, config: &HostConfig) {
        *self = match config.ping_period {
            Some(period) => Self::Due(now.max(sent + period)),
            None => Self::Off,
        };
    }
}
