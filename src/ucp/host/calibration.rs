//! Calibration requests: sent, repeated, acknowledged or given up.

use super::{
    config::HostConfig,
    event::{CalibrationFailure, CalibrationStep, FailureCause, HostEvent},
};
use crate::{
    time::{Instant, reached},
    ucp::codes::{CalibrationKind, ErrorCode},
};

/// A request that has not been settled.
#[derive(Clone, Debug)]
pub(super) struct Request {
    step: CalibrationStep,
    kind: CalibrationKind,
    /// The calibration that the robot was last told to start, if known.
    last_start: Option<CalibrationKind>,
    attempts: u8,
    /// Outcome of the latest attempt so far.
    cause: FailureCause,
    wait: Wait,
    /// When it is given up if it cannot be sent; from when it could be sent first.
    until: Option<Instant>,
}

#[derive(Clone, Copy, Debug)]
enum Wait {
    /// To be sent at this time.
    Send(Instant),
    /// To be acknowledged by this time.
    Ack(Instant),
}

/// Effect of an acknowledgement.
#[derive(Debug)]
pub(super) enum Answer {
    /// It was not expected.
    Unasked,
    /// The request will be sent again.
    Again,
    /// The request is settled.
    Settled(HostEvent),
}

impl Request {
    pub(super) const fn new(
        step: CalibrationStep,
        kind: CalibrationKind,
        last_start: Option<CalibrationKind>,
        now: Instant,
    ) -> Self {
        let (cause, wait) = (FailureCause::NoAnswer, Wait::Send(now));
        Self { step, kind, last_start, attempts: 0, cause, wait, until: None }
    }

    /// Its driver asks for frames, so that it can be sent from now on.
    pub(super) fn begin(&mut self, now: Instant, config: &HostConfig) {
        self.until.get_or_insert_with(|| now + config.calibration_bound());
    }

    /// The request to send now, if any, and whether it is a repetition.
    pub(super) fn take_due(
        &mut self,
        now: Instant,
        config: &HostConfig,
    ) -> Option<(CalibrationStep, CalibrationKind, bool)> {
        let Wait::Send(at) = self.wait else { return None };
        if at > now {
            return None;
        }
        let again = self.attempts > 0;
        self.attempts = self.attempts.saturating_add(1);
        self.cause = FailureCause::NoAnswer;
        self.wait = Wait::Ack(now + config.ack_wait());
        Some((self.step, self.kind, again))
    }

    /// Takes back the latest attempt, which did not reach the line: it does not count, and is due
    /// again.
    pub(super) const fn unsent(&mut self, now: Instant) {
        self.attempts = self.attempts.saturating_sub(1);
        self.wait = Wait::Send(now);
    }

    /// Processes an acknowledgement.
    ///
    /// A good acknowledgement of a start must have the kind asked for. In a bad one the kind is
    /// ignored, because the vendor firmware returns that of the previous start. When it
    /// acknowledges an end, it returns the kind of the last start, so that kind is accepted too,
    /// and any kind if the last start is unknown.
    pub(super) fn acknowledge(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        err: ErrorCode,
        now: Instant,
        config: &HostConfig,
    ) -> Answer {
        let is_its_kind = kind == self.kind
            || match step {
                CalibrationStep::Start => err != ErrorCode::Fine,
                CalibrationStep::End => self.last_start.is_none_or(|last| kind == last),
            };
        if step != self.step || self.attempts == 0 || !is_its_kind {
            return Answer::Unasked;
        }
        if err != ErrorCode::Fine {
            self.cause = FailureCause::Refused(err);
            return match self.retry(now, config) {
                Some(failure) => Answer::Settled(HostEvent::CalibrationFailed(failure)),
                None => Answer::Again,
            };
        }
        Answer::Settled(match step {
            CalibrationStep::Start => HostEvent::CalibrationStarted(self.kind),
            CalibrationStep::End => HostEvent::CalibrationEnded(self.kind),
        })
    }

    /// Sends again, or gives up, when the acknowledgement is late. Gives up what could not be sent.
    pub(super) fn expire(
        &mut self,
        now: Instant,
        config: &HostConfig,
    ) -> Option<CalibrationFailure> {
        match self.wait {
            Wait::Ack(until) if until <= now => self.retry(now, config),
            Wait::Send(_) if reached(self.until, now) => Some(self.failure()),
            _ => None,
        }
    }

    pub(super) const fn deadline(&self) -> Instant {
        match self.wait {
            Wait::Send(at) | Wait::Ack(at) => at,
        }
    }

    fn retry(&mut self, now: Instant, config: &HostConfig) -> Option<CalibrationFailure> {
        if self.attempts < config.attempts {
            self.wait = Wait::Send(now);
            return None;
        }
        Some(self.failure())
    }

    const fn failure(&self) -> CalibrationFailure {
        CalibrationFailure::new(self.step, self.kind, self.cause, self.attempts)
    }
}
