//! The results of one kind of calibration: the one accepted, and whether to acknowledge it.

use crate::time::Instant;

/// An acknowledgement does not identify its result, so it must be true of the latest one (ruling
/// U15).
#[derive(Clone, Debug)]
pub(super) struct Results<B> {
    /// The latest one accepted since the calibration began, to recognise a repetition.
    taken: Option<B>,
    /// Whether the latest one received is not kept anywhere.
    pub(super) is_refused: bool,
    /// Time since which the acknowledgement is due.
    pub(super) ack_due: Option<Instant>,
}

impl<B: PartialEq> Results<B> {
    pub(super) const fn new() -> Self {
        Self { taken: None, is_refused: false, ack_due: None }
    }

    /// Begins a calibration: the same result again is then a new one.
    pub(super) fn begin(&mut self) {
        self.taken = None;
    }

    pub(super) fn is_repetition(&self, result: &B) -> bool {
        self.taken.as_ref() == Some(result)
    }

    /// Records a result that is where the application will find it.
    pub(super) fn accept(&mut self, result: B, ack_due: Option<Instant>) {
        (self.taken, self.is_refused, self.ack_due) = (Some(result), false, ack_due);
    }

    /// Records a result that is not kept: the robot would take an acknowledgement of the previous
    /// one for this one.
    pub(super) fn refuse(&mut self) {
        (self.is_refused, self.ack_due) = (true, None);
    }

    /// Takes back an acknowledgement that did not leave.
    pub(super) fn ack_unsent(&mut self, now: Instant) {
        if !self.is_refused {
            self.ack_due = Some(now);
        }
    }
}
