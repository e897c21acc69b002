//! Set-points: what a node was last told, whether it has left, and its confirmation (I8).

use crate::ikeya::board::{Board, Target};

/// What a node is told, again in every cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct SetPoint<B: Board> {
    pub(super) target: Target<B>,
    /// It has not been sent yet.
    pub(super) is_new: bool,
    /// It is the target of a stop that has been paid (I6).
    pub(super) is_stop: bool,
}

impl<B: Board> SetPoint<B> {
    /// A command of the application.
    pub(super) const fn new(target: Target<B>) -> Self {
        Self { target, is_new: true, is_stop: false }
    }

    /// What is left of a stop once it is paid: 0 rps or the position that was held.
    pub(super) const fn of_stop(target: Target<B>) -> Self {
        Self { target, is_new: false, is_stop: true }
    }
}

/// Progress of the confirmation of a WRITE.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Confirm {
    /// The application has not asked for one.
    Unasked,
    /// The next WRITE is to be confirmed.
    AfterWrite,
    /// The WRITE has been sent; the next answer confirms it.
    AfterAnswer,
}
