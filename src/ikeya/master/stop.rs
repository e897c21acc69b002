//! Stops: debts that are paid by two WRITEs, each followed by an answer (I6, I12).

use crate::{
    ikeya::board::{Board, Status},
    time::{Duration, Instant},
};

/// Stop WRITEs that must be followed by a good answer before a stop is paid.
const PAYMENTS: u8 = 2;

/// Time within which a measured position must be written, or it is measured again. It doubles with
/// each position that is given up, so that even a slow loop eventually writes one.
const HOLD_PATIENCE: Duration = Duration::from_millis(20);

/// Minimum time between two positions that are compared: 8 counts in this time are 0.05 rps.
const STANDSTILL_TIME: Duration = Duration::from_millis(20);

/// A stop that is owed to a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop<B: Board> {
    /// The position to hold for a position node; `None` until it has been measured.
    pub(super) hold: Option<B::Position>,
    /// Time of that measurement.
    measured_at: Option<Instant>,
    /// Time within which it must be written.
    patience: Duration,
    /// Whether a stop WRITE has been sent and waits for an answer.
    pub(super) is_written: bool,
    /// Stop WRITEs sent.
    pub(super) writes: u8,
    /// Whether the open window, if any, was opened after the stop was requested.
    pub(super) is_asked: bool,
    /// Stop WRITEs that were followed by a good answer.
    paid: u8,
    /// Attempts made while the node was not online.
    pub(super) lost_attempts: u8,
}

impl<B: Board> Stop<B> {
    /// A new debt. `hold` is a position that may be held without measuring again, treated as
    /// measured at `measured_at`.
    pub(super) const fn new(hold: Option<B::Position>, measured_at: Option<Instant>) -> Self {
        Self {
            hold,
            measured_at,
            patience: HOLD_PATIENCE,
            is_written: false,
            writes: 0,
            is_asked: false,
            paid: 0,
            lost_attempts: 0,
        }
    }

    /// Discards everything measured or paid so far: the node was abnormal, or its mode in doubt.
    #[inline(never)]
    pub(super) fn restart(&mut self) {
        (self.hold, self.measured_at) = (None, None);
        (self.is_written, self.writes, self.paid) = (false, 0, 0);
    }

    /// Keeps the position of an answer to hold, if it was requested after the stop.
    pub(super) fn measure(&mut self, status: &Status<B>, now: Instant) {
        if let (Status::Position(position), None, true) = (status, self.hold, self.is_asked) {
            (self.hold, self.measured_at, self.writes) = (Some(*position), Some(now), 0);
        }
    }

    /// Whether a position has been measured for this stop but not written yet.
    pub(super) const fn is_measured(&self) -> bool {
        self.is_asked && self.measured_at.is_some() && self.writes == 0
    }

    /// Gives up a position that could not be written at once, allowing for the `gap` after each
    /// packet.
    pub(super) fn forget_old_hold(&mut self, now: Instant, gap: Duration) {
        if self.writes > 0 {
            return;
        }
        if self.measured_at.is_some_and(|at| now - at > self.patience + gap) {
            (self.hold, self.measured_at) = (None, None);
            self.patience = self.patience + self.patience;
        }
    }

    /// Counts a good answer in the node's mode; returns whether the stop is now paid.
    pub(super) fn pay(&mut self) -> bool {
        if core::mem::take(&mut self.is_written) {
            self.paid += 1;
        }
        self.paid >= PAYMENTS
    }
}

/// Progress of a stop, see [`Master::stop_progress`](super::Master::stop_progress).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StopProgress {
    /// The node's latest command, if any, is not a stop.
    NotAsked,
    /// The stop is owed: it has not been confirmed twice yet.
    Owed,
    /// The node has confirmed the stop twice, and may still be slowing down.
    Paid,
    /// The node has confirmed the stop twice, and was found standing still.
    StandingStill,
}

/// The watch for standstill after a stop is paid.
#[derive(Clone, Copy, Debug)]
pub(super) enum Standstill<B: Board> {
    /// There is no paid stop.
    Unwatched,
    /// Watched, with a status to compare the next ones with.
    Watched(Option<(Status<B>, Instant)>),
    /// Standstill was measured.
    Reached,
}

impl<B: Board> Standstill<B> {
    /// Processes a status; returns whether it is the first to show a standstill.
    pub(super) fn watch(&mut self, status: Status<B>, now: Instant) -> bool {
        let Self::Watched(before) = *self else { return false };
        let is_still = match (status, before) {
            (Status::Velocity(speed), _) => B::is_still(speed),
            (Status::Position(here), Some((Status::Position(there), at))) => {
                if now - at < STANDSTILL_TIME {
                    return false;
                }
                B::is_same_place(here, there)
            }
            (Status::Position(_), _) => false,
        };
        *self = if is_still { Self::Reached } else { Self::Watched(Some((status, now))) };
        is_still
    }
}
