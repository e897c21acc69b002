//! Set-points: the last command to a node, whether it has left, and its confirmation (I8).

use crate::ikeya::board::{Board, Target};

/// The set-point of a node, repeated in every cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct SetPoint<B: Board> {
    pub(super) target: Target<B>,
    /// Whether it has not been sent yet.
    pub(super) is_new: bool,
    /// Whether it is the target of a paid stop (I6).
    pub(super) is_stop: bool,
}

impl<B: Board> SetPoint<B> {
    /// A command from the application.
    pub(super) const fn new(target: Target<B>) -> Self {
        Self { target, is_new: true, is_stop: false }
    }

    /// The set-point that a paid stop leaves behind: 0 rps or the held position.
    pub(super) const fn of_stop(target: Target<B>) -> Self {
        Self { target, is_new: false, is_stop: true }
    }
}

/// Progress of confirming a WRITE.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Confirm {
    /// The application has not asked for a confirmation.
    Unasked,
    /// The next WRITE is to be confirmed.
    AfterWrite,
    /// The WRITE has been sent; the next answer confirms it.
    AfterAnswer,
}
