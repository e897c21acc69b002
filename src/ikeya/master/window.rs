//! The reply window: the node that was asked, and its deadline (I7). `replies` decides which
//! replies it accepts.

use super::event::Cause;
use crate::{ikeya::units::NodeId, time::Instant};

/// A node has been asked and may answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) node: NodeId,
    pub(super) request_end: Instant,
    pub(super) deadline: Instant,
    pub(super) heard: Heard,
    /// Whether the request left only after the deadline. Its answer is too old when it comes; the
    /// window is open again until then, so that the answer does not meet the next request.
    pub(super) is_missed: bool,
}

/// What has been heard in the window.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Heard {
    Nothing,
    Bytes,
    Others,
}

impl Window {
    pub(super) fn cause(&self) -> Cause {
        match self.heard {
            Heard::Nothing => Cause::Silent,
            Heard::Bytes => Cause::Damaged,
            Heard::Others => Cause::Unexpected,
        }
    }

    pub(super) fn hear_bytes(&mut self) {
        if self.heard == Heard::Nothing {
            self.heard = Heard::Bytes;
        }
    }
}
