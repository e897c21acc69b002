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
}

/// What the port has taken and may still hold, so that its answer is still to come.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Held {
    Nothing,
    /// The last exchange, with this node.
    Last(NodeId),
    /// Earlier ones as well: it is unknown whose answer comes.
    Several,
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
