//! The results of one kind of calibration: which was taken, and whether it is to be acknowledged.

use crate::time::Instant;

/// An acknowledgement does not say of which result: what it says has to be true of the latest
/// (ruling U15).
#[derive(Clone, Debug)]
pub(super) struct Results<B> {
    /// The latest one taken since the calibration began, to know a repetition.
    taken: Option<B>,
    /// The latest one received is not kept anywhere.
    is_refused: bool,
    /// Since when the acknowledgement is due.
    pub(super) ack_due: Option<Instant>,
}

impl<B: PartialEq> Results<B> {
    pub(super) const fn new() -> Self {
        Self { taken: None, is_refused: false, ack_due: None }
    }

    /// A calibration begins: the same result once more is a new one.
    pub(super) fn begin(&mut self) {
        self.taken = None;
    }

    pub(super) fn is_repetition(&self, result: &B) -> bool {
        self.taken.as_ref() == Some(result)
    }

    /// The result is where the application will find it.
    pub(super) fn accept(&mut self, result: B, ack_due: Option<Instant>) {
        (self.taken, self.is_refused, self.ack_due) = (Some(result), false, ack_due);
    }

    /// The result is not kept: the robot would take an acknowledgement of the one before for its.
    pub(super) fn refuse(&mut self) {
        (self.is_refused, self.ack_due) = (true, None);
    }

    /// The acknowledgement did not leave.
    pub(super) fn ack_unsent(&mut self, now: Instant) {
        if !self.is_refused {
            self.ack_due = Some(now);
        }
    }
}
