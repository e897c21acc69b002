//! A firmware update: asked for, requested, silent.

use crate::time::{Duration, Instant};

/// Longest time for which the request waits for its port. With the time since the last look, at
/// most as much, no report of motion behind it is older than 20 ms.
const PATIENCE: Duration = Duration::from_millis(10);

/// Progress of a firmware update. Its request is sent once, or not at all.
#[derive(Clone, Copy, Debug)]
pub(super) enum Update {
    None,
    /// The request is due behind stops, if the reports then still show a standstill.
    Asked {
        version: i16,
        at: Instant,
    },
    /// The request has been handed out, and may have arrived: the line belongs to the update.
    Silent {
        since: Instant,
    },
}

impl Update {
    pub(super) const fn is_none(&self) -> bool {
        matches!(self, Self::None)
    }

    /// Whether the line belongs to the update.
    pub(super) const fn is_silent(&self) -> bool {
        matches!(self, Self::Silent { .. })
    }

    /// When the request has waited for its port for too long to be sure of a standstill.
    pub(super) fn overdue_at(&self) -> Option<Instant> {
        match *self {
            Self::Silent { since } => Some(since + PATIENCE),
            _ => None,
        }
    }
}
