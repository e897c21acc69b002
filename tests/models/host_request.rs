//! A host's requests to a robot, and the results it has received.

use axlewire::ucp::BAUD;

use super::names::*;

/// A calibration request: sent at most three times, 200 ms apart.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) step: CalibrationStep,
    pub(crate) kind: CalibrationKind,
    pub(crate) attempts: u8,
    /// `None`: has to be sent now.
    pub(crate) until: Option<Instant>,
    /// When it is given up if it cannot be sent; from when it could be sent first.
    pub(crate) bound: Option<Instant>,
}

/// Time for the acknowledgement of a request.
fn wait() -> Duration {
    wire_time(9, BAUD) + ms(200)
}

/// Whether a result may be acknowledged (U15).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ack {
    No,
    May,
    Must,
}

/// The results of one kind.
#[derive(Clone, Debug)]
pub(crate) struct Results {
    pub(crate) ack: Ack,
    /// The latest one is in the store, or its event is queued.
    pub(crate) is_kept: bool,
    /// The latest event taken since the calibration began.
    pub(crate) popped: Option<HostEvent>,
}

impl Request {
    pub(crate) const fn new(step: CalibrationStep, kind: CalibrationKind) -> Self {
        Self { step, kind, attempts: 0, until: None, bound: None }
    }

    /// The driver asks for frames.
    pub(crate) fn begin(&mut self, now: Instant) {
        self.bound.get_or_insert(now + wait().saturating_mul(3));
    }

    /// The request is sent; returns whether that is allowed.
    pub(crate) fn frame(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        now: Instant,
    ) -> bool {
        let is_this = (self.step, self.kind) == (step, kind);
        let is_due = self.until.is_none() && self.attempts < 3;
        self.attempts += 1;
        self.until = Some(now + wait());
        is_this && is_due
    }
}

impl Results {
    pub(crate) const fn new() -> Self {
        Self { ack: Ack::No, is_kept: false, popped: None }
    }
}
