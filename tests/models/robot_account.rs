//! The account of a robot: its commands and requests, what may be sent, and what is owed.

use super::names::*;

/// Something that is sent every 1000 ms until the host has it (U11).
#[derive(Clone, Debug)]
pub(crate) struct Repeat {
    pub(crate) what: Option<i16>,
    /// Earliest time.
    earliest: Instant,
    /// Latest time.
    latest: Instant,
    sendings: u8,
}

impl Repeat {
    fn new(what: Option<i16>, now: Instant) -> Self {
        Self { what, earliest: now, latest: now, sendings: 0 }
    }

    pub(crate) fn begin(&mut self, what: i16, now: Instant) {
        *self = Self::new(Some(what), now);
    }

    pub(crate) fn end(&mut self) {
        self.what = None;
    }

    pub(crate) const fn was_sent(&self) -> bool {
        self.what.is_some() && self.sendings > 0
    }

    fn frame(&mut self, is_it: impl Fn(i16) -> bool, now: Instant) -> bool {
        let is_right = self.what.is_some_and(is_it) && self.earliest <= now;
        (self.earliest, self.latest) = (now + ms(1000), now + ms(1000));
        // Larger counts make no difference.
        self.sendings = (self.sendings + 1).min(2);
        is_right
    }

    fn take_back(&mut self, now: Instant) {
        (self.earliest, self.latest) = (now, now);
        self.sendings = self.sendings.saturating_sub(1);
    }

    fn due(&self) -> Option<Instant> {
        self.what.map(|_| self.latest)
    }
}

#[derive(Clone, Copy, Debug)]
enum Last {
    StartAck(CalibrationKind),
    EndAck(CalibrationKind),
    UpdateAnswer,
    Pong,
    Imu,
    Mag,
    BiasRequest,
    /// Its due time.
    Report(Instant),
}

#[derive(Clone, Debug)]
pub(crate) struct Account {
    /// The last valid command, and the time until which it holds.
    pub(crate) command: MotorControl,
    pub(crate) until: Option<Instant>,
    /// As reported by `take_command` and by the events.
    pub(crate) taken: MotorControl,
    pub(crate) told: MotorControl,
    pub(crate) start_ack: Option<CalibrationKind>,
    pub(crate) end_ack: Option<CalibrationKind>,
    pub(crate) pong: bool,
    /// `false`: it may have left.
    pub(crate) update_answer: Option<(OtaStatus, bool)>,
    /// The latest answer to an update, and when it was handed out.
    answered: Option<(OtaStatus, Instant)>,
    pub(crate) is_update_asked: bool,
    /// `true` once its result is available.
    pub(crate) calibrating: Option<(CalibrationKind, bool)>,
    pub(crate) imu: Repeat,
    pub(crate) mag: Repeat,
    pub(crate) bias_request: Repeat,
    pub(crate) telemetry: Telemetry,
    pub(crate) report_at: Option<Instant>,
    pub(crate) network: Option<u32>,
    last: Option<Last>,
    index: u8,
}

impl Account {
    pub(crate) fn new(config: &RobotConfig, now: Instant) -> Self {
        Self {
            command: MotorControl::STOP,
            until: None,
            taken: MotorControl::STOP,
            told: MotorControl::STOP,
            start_ack: None,
            end_ack: None,
            pong: false,
            update_answer: None,
            answered: None,
            is_update_asked: false,
            calibrating: None,
            imu: Repeat::new(None, now),
            mag: Repeat::new(None, now),
            bias_request: Repeat::new(config.bias_request_period.map(|_| 0), now),
            telemetry: Telemetry::default(),
            report_at: None,
            network: None,
            last: None,
            index: 0,
        }
    }

    /// A valid command arrived at this time.
    pub(crate) fn commanded(&mut self, command: MotorControl, at: Instant) {
        (self.command, self.until) = (command, Some(at + ms(500)));
    }

    /// The robot's current motion: none, 500 ms after the last valid command.
    pub(crate) fn expected(&self, now: Instant) -> MotorControl {
        if self.until.is_some_and(|until| now < until) {
            self.command
        } else {
            halted(self.command)
        }
    }

    /// A frame is sent.
    pub(crate) fn frame(&mut self, bytes: &[u8], now: Instant) -> Checked {
        let frame = Frame::parse(bytes).map_err(|error| format!("not a frame: {error:?}"))?;
        let message = frame.message();
        let is_fine = |err| err == ErrorCode::Fine;
        let (is_right, last) = match message {
            Message::Pong(pong) => {
                (std::mem::take(&mut self.pong) && is_fine(pong.err()), Last::Pong)
            }
            Message::CalibrationStartAck(ack) => {
                let is_due = self.start_ack.take() == Some(ack.kind());
                (is_due && is_fine(ack.err()), Last::StartAck(ack.kind()))
            }
            Message::CalibrationEndAck(ack) => {
                let is_due = self.end_ack.take() == Some(ack.kind());
                (is_due && is_fine(ack.err()), Last::EndAck(ack.kind()))
            }
            Message::OtaAck(ack) => {
                let answer = self.update_answer.take();
                let is_right = answer.is_some_and(|(status, _)| status == ack.status());
                self.answered = Some((ack.status(), now));
                (is_right, Last::UpdateAnswer)
            }
            Message::ImuBias(bias) => (self.imu.frame(|value| imu(value) == *bias, now), Last::Imu),
            Message::MagBias(bias) => (self.mag.frame(|value| mag(value) == *bias, now), Last::Mag),
            Message::BiasRequest(_) => (self.bias_request.frame(|_| true, now), Last::BiasRequest),
            Message::Report(report) => {
                let at = self.report_at.unwrap_or(now + ms(1));
                let is_right = at <= now
                    && report.telemetry() == self.telemetry
                    && frame.index() == self.index;
                let mut next = at;
                while next <= now {
                    next += ms(20);
                }
                self.report_at = Some(next);
                self.index = self.index.wrapping_add(1);
                (is_right, Last::Report(at))
            }
            _ => (false, Last::Pong),
        };
        self.last = Some(last);
        let is_right = is_right && (frame.index() == 0 || matches!(last, Last::Report(_)));
        if is_right { Ok(()) } else { Err(format!("{message:?} must not be sent: {self:?}")) }
    }

    /// The last frame comes back, or a flush has failed.
    pub(crate) fn unsent(&mut self, unsent: Unsent, now: Instant) {
        let last = self.last.take();
        let is_lost = unsent != Unsent::Unflushed;
        // An update is requested once: its answer is repeated if it may be lost.
        if let Some((status, at)) = self.answered.filter(|_| !self.is_update_asked) {
            let is_last = matches!(last, Some(Last::UpdateAnswer));
            if is_last && is_lost || !is_lost && now - at <= ms(2000) {
                self.update_answer.get_or_insert((status, is_lost));
            }
        }
        match last {
            _ if !is_lost => {}
            Some(Last::UpdateAnswer) => {}
            Some(Last::StartAck(kind)) => {
                self.start_ack.get_or_insert(kind);
            }
            Some(Last::EndAck(kind)) => {
                self.end_ack.get_or_insert(kind);
            }
            Some(Last::Pong) => self.pong = true,
            Some(Last::Imu) => self.imu.take_back(now),
            Some(Last::Mag) => self.mag.take_back(now),
            Some(Last::BiasRequest) => self.bias_request.take_back(now),
            Some(Last::Report(at)) => {
                (self.report_at, self.index) = (Some(at), self.index.wrapping_sub(1));
            }
            _ => {}
        }
        if !is_lost {
            for repeat in [&mut self.imu, &mut self.mag, &mut self.bias_request] {
                repeat.earliest = now;
            }
        }
    }

    /// The latest time for the next action.
    pub(crate) fn owed(&self, now: Instant) -> Option<Instant> {
        let is_due = self.pong
            || self.start_ack.is_some()
            || self.end_ack.is_some()
            || self.update_answer.is_some_and(|(_, must)| must);
        let repeats = [self.imu.due(), self.mag.due(), self.bias_request.due()];
        let times = repeats.into_iter().chain([self.until, self.report_at]);
        times.flatten().chain(is_due.then_some(now)).min()
    }
}
