//! Pings, one at a time: a pong does not say which ping it answers.

use super::config::HostConfig;
use crate::time::{Duration, Instant};

/// Where the ping is.
#[derive(Clone, Copy, Debug)]
pub(super) enum PingState {
    /// Not wanted.
    Off,
    /// To be sent then.
    Due(Instant),
    /// Sent, and lost if no pong comes.
    Sent { at: Instant, until: Instant },
}

impl PingState {
    pub(super) fn new(now: Instant, config: &HostConfig) -> Self {
        if config.ping_period.is_some() { Self::Due(now) } else { Self::Off }
    }

    /// Is a ping to be sent now? It counts as sent.
    pub(super) fn take_due(&mut self, now: Instant, config: &HostConfig) -> bool {
        let due = matches!(*self, Self::Due(at) if at <= now);
        if due {
            *self = Self::Sent { at: now, until: now + config.ping_timeout };
        }
        due
    }

    /// A pong has arrived: how long it took, if it was waited for.
    pub(super) fn pong(&mut self, now: Instant, config: &HostConfig) -> Option<Duration> {
        let Self::Sent { at, .. } = *self else { return None };
        self.next(at, now, config);
        Some(now - at)
    }

    /// Gives up the ping whose pong is late; says whether that is now.
    pub(super) fn expire(&mut self, now: Instant, config: &HostConfig) -> bool {
        let Self::Sent { at, until } = *self else { return false };
        let late = until <= now;
        if late {
            self.next(at, now, config);
        }
        late
    }

    /// The ping did not reach the line and is due again; `false` if it has been given up by now.
    pub(super) fn unsent(&mut self, now: Instant) -> bool {
        let sent = matches!(self, Self::Sent { .. });
        if sent {
            *self = Self::Due(now);
        }
        sent
    }

    /// Ends a silence: what was due during it is due now.
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

    /// The ping sent at `sent` is done with.
    fn next(&mut self, sent: Instant, now: Instant, config: &HostConfig) {
        *self = match config.ping_period {
            Some(period) => Self::Due(now.max(sent + period)),
            None => Self::Off,
        };
    }
}
