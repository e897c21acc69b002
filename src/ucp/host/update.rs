//! A firmware update: asked for, requested, silent.

use super::standstill::COAST;
use crate::time::{Duration, Instant};

/// Longest time for which the request waits for its port before reports are read again: one report.
const PATIENCE: Duration = Duration::from_millis(20);

/// Progress of a firmware update.
#[derive(Clone, Debug)]
pub(super) struct Update {
    step: Step,
    version: i16,
    /// When it was asked for.
    asked_at: Instant,
    /// When the request was handed out.
    sent_at: Instant,
    /// The robot may have an earlier request: its flush failed, or it was refused, perhaps not by
    /// this answer. Until the application stops, drives or calibrates.
    may_have_left: bool,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Step {
    None,
    /// The request is to be sent behind stops while the reports show a standstill.
    Asked,
    /// The request has been sent; the line belongs to the update.
    Silent,
}

impl Update {
    pub(super) const fn new(now: Instant) -> Self {
        let step = Step::None;
        Self { step, version: 0, asked_at: now, sent_at: now, may_have_left: false }
    }

    pub(super) fn is_none(&self) -> bool {
        self.step == Step::None
    }

    /// Whether the line belongs to the update.
    pub(super) fn is_silent(&self) -> bool {
        self.step == Step::Silent
    }

    pub(super) fn is_asked(&self) -> bool {
        self.step == Step::Asked
    }

    pub(super) const fn version(&self) -> i16 {
        self.version
    }

    /// Whether the robot may have received a request, whatever its flush said.
    pub(super) fn may_have_left(&self) -> bool {
        self.is_silent() || self.may_have_left
    }

    pub(super) const fn ask(&mut self, version: i16, now: Instant) {
        (self.step, self.version, self.asked_at) = (Step::Asked, version, now);
    }

    /// The request is handed out, or has been accepted.
    pub(super) const fn begin(&mut self, now: Instant) {
        (self.step, self.sent_at) = (Step::Silent, now);
    }

    /// The request has come back: it is due again.
    pub(super) const fn ask_again(&mut self, may_have_left: bool) {
        self.step = Step::Asked;
        self.may_have_left |= may_have_left;
    }

    pub(super) const fn end(&mut self) {
        self.step = Step::None;
    }

    /// The robot has refused a request: this one, or one before.
    pub(super) const fn refuse(&mut self) {
        self.may_have_left = true;
    }

    /// The application has decided: an answer that is still to come means nothing.
    pub(super) const fn forget(&mut self) {
        self.may_have_left = false;
    }

    /// When a request that cannot be sent is given up.
    pub(super) fn until(&self) -> Instant {
        self.asked_at + COAST
    }

    /// When it was asked for.
    pub(super) const fn asked_at(&self) -> Instant {
        self.asked_at
    }

    /// When the request was handed out.
    pub(super) const fn sent_at(&self) -> Instant {
        self.sent_at
    }

    /// When the request has waited for its port for too long to be sure of a standstill.
    pub(super) fn overdue_at(&self) -> Instant {
        self.sent_at + PATIENCE
    }
}
