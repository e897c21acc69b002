//! Calibration requests: acknowledged, repeated, given up.

use super::{
    config::HostConfig,
    event::{CalibrationFailure, CalibrationStep, FailureCause, HostEvent},
};
use crate::{
    time::Instant,
    ucp::codes::{CalibrationKind, ErrorCode},
};

/// A request that has not been settled.
#[derive(Clone, Debug)]
pub(super) struct Request {
    step: CalibrationStep,
    kind: CalibrationKind,
    /// What the robot has been told to begin last, if that is known.
    last_start: Option<CalibrationKind>,
    attempts: u8,
    /// What the latest attempt has come to so far.
    cause: FailureCause,
    wait: Wait,
}

#[derive(Clone, Copy, Debug)]
enum Wait {
    /// To be sent then.
    Send(Instant),
    /// To be acknowledged by then.
    Ack(Instant),
}

/// What an acknowledgement has done.
#[derive(Debug)]
pub(super) enum Answer {
    /// Nobody was waiting for it.
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
        Self { step, kind, last_start, attempts: 0, cause, wait }
    }

    /// What to send now, if anything, and whether it was sent before.
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

    /// The latest attempt did not reach the line: it does not count, and is due again.
    pub(super) const fn unsent(&mut self, now: Instant) {
        self.attempts = self.attempts.saturating_sub(1);
        self.wait = Wait::Send(now);
    }

    /// Takes in an acknowledgement.
    ///
    /// After a good start its kind is the kind asked for. In a bad one the vendor firmware tells
    /// the kind of the start before, so that is not looked at. After an end it tells the kind of
    /// the last start, so that counts as well as the kind asked for, and any kind where the last
    /// start is not known.
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

    /// Sends again, or gives up, when the acknowledgement is late.
    pub(super) fn expire(
        &mut self,
        now: Instant,
        config: &HostConfig,
    ) -> Option<CalibrationFailure> {
        match self.wait {
            Wait::Ack(until) if until <= now => self.retry(now, config),
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
        Some(CalibrationFailure::new(self.step, self.kind, self.cause, self.attempts))
    }
}
