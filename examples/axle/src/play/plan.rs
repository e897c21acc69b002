//! What to send, and when.

use std::collections::VecDeque;

use axlewire::ikeya::Mode;

use super::{
    effect::{Effect, Limits, Side},
    summary::Summary,
};
use crate::{args::Protocol, bus::MasterArgs, listing::Modes};

/// A frame and when to send it.
#[derive(Clone, Debug)]
pub(crate) struct Due {
    /// After the beginning, microseconds.
    pub(crate) after_us: u64,
    pub(crate) bytes: Box<[u8]>,
    /// For a WRITE, the mode that it was meant for, if that is known.
    pub(crate) meant: Option<Mode>,
    pub(crate) effect: Effect,
}

/// What to send, and how.
pub(crate) struct Plan<'a> {
    pub(crate) bus: &'a MasterArgs,
    pub(crate) protocol: Protocol,
    pub(crate) side: Side,
    pub(crate) frames: VecDeque<Due>,
    /// The modes of the nodes in the capture.
    pub(crate) modes: Modes,
    /// Whether a READ goes behind each WRITE.
    pub(crate) reads_back: bool,
    /// How long to listen after the last frame, microseconds; motors keep moving meanwhile.
    pub(crate) linger_us: u64,
    pub(crate) limits: Limits,
    pub(crate) is_json: bool,
    /// What is not as one would expect, to be said first.
    pub(crate) notes: Vec<String>,
    /// What is not in the plan, for a summary at the end.
    pub(crate) summary: Option<Summary>,
}
