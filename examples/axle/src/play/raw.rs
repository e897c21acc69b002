//! Frames that move nothing, without a role.

use axlewire::{endpoint::Endpoint, time::Instant};

use super::playing::{Due, Plan, Voice};
use crate::{failure::Failure, line::Line, session::Session, signals::Signals};

/// A role that never speaks.
pub(super) struct Nobody;

impl Endpoint for Nobody {
    type Event = ();

    fn handle_input(&mut self, _: &[u8], _: Instant) {}

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        None
    }

    fn poll_event(&mut self) -> Option<()> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}

/// A line on which only the frames of a plan are sent.
pub(super) struct Raw(Session<Nobody>);

impl Voice for Raw {
    fn prepare(_: &Plan<'_>, line: Line, _: &Signals) -> Result<Option<Self>, Failure> {
        Ok(Some(Self(Session::new(line, |_| Nobody))))
    }

    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn is_free(&self) -> bool {
        true
    }

    fn give(&mut self, due: &Due, _: Instant) -> Result<bool, Failure> {
        self.0.interject(&due.bytes)
    }

    fn round(&mut self, until: Instant) -> Result<(), Failure> {
        self.0.round(until).map(drop)
    }

    fn stop(self) -> Result<Vec<String>, Failure> {
        Ok(Vec::new())
    }
}
