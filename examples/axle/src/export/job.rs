//! What is to be exported, and to what.

use std::path::Path;

use crate::{beside, decode::Chosen, failure::Failure, input::Input, signals::Signals};

/// What an exporter needs.
pub(super) struct Job<'a> {
    pub(super) input: Input,
    pub(super) chosen: Chosen,
    pub(super) output: &'a Path,
    pub(super) force: bool,
    pub(super) signals: Signals,
}

impl Job<'_> {
    /// Fails after a signal.
    pub(super) fn go_on(signals: &Signals) -> Result<(), Failure> {
        if signals.is_raised() { Err(beside::interrupted()) } else { Ok(()) }
    }
}
