//! What a host knows, is waiting for and has to send.

use super::{
    CalibrationStep, CommandError, HostConfig, HostEvent, HostStatistics, Link, ReceivedReport,
    UnknownFrame,
    calibration::{Answer, Request},
    motor::Motor,
    ping::Ping,
};
use crate::{
    time::Instant,
    ucp::{
        self, BiasStore, Biases, CalibrationEnd, CalibrationKind, CalibrationStart, ErrorCode,
        Frame, ImuBias, ImuBiasAck, MAX_LEN, MagBias, MagBiasAck, Message, OtaRequest, OtaStatus,
        Pong, RawFrame, Report, SetNetworkState,
        role::{Events, bump, is_from_host, reached, write},
    },
};

/// Everything but the bytes.
#[derive(Debug)]
pub(super) struct State<S> {
    pub(super) config: HostConfig,
    pub(super) store: S,
    pub(super) events: Events<HostEvent, 16>,
    pub(super) stats: HostStatistics,
    /// Counter of the next frame.
    pub(super) index: u8,
    pub(super) link: Link,
    /// When the link goes down.
    link_until: Option<Instant>,
    pub(super) motor: Motor,
    ping: Ping,
    pub(super) calibration: Option<Request>,
    pub(super) update: Update,
    pub(super) network: Option<SetNetworkState>,
    pub(super) last_report: Option<ReceivedReport>,
    /// Index of the report before, where there is one to count from.
    last_index: Option<u8>,
    /// Results taken since the calibration began, to know a repetition.
    imu_taken: Option<ImuBias>,
    mag_taken: Option<MagBias>,
    /// What is to be sent, and since when.
    imu_ack_due: Option<Instant>,
    mag_ack_due: Option<Instant>,
    biases_due: Option<(Instant, Biases)>,
    pub(super) network_due: Option<Instant>,
}

/// Where a firmware update is.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Update {
    None,
    /// The request is to be sent.
    Asked {
        version: i16,
        at: Instant,
    },
    /// The request was sent, the line belongs to the update.
    Silent,
}

impl<S: BiasStore> State<S> {
    pub(super) fn new(config: HostConfig, store: S, now: Instant) -> Self {
        Self {
            config,
            store,
            events: Events::new(),
            stats: HostStatistics::default(),
            index: 0,
            link: Link::Waiting,
            link_until: Some(now + config.link_timeout),
            motor: Motor::default(),
            ping: Ping::new(now, &config),
            calibration: None,
            update: Update::None,
            network: None,
            last_report: None,
            last_index: None,
            imu_taken: None,
            mag_taken: None,
            imu_ack_due: None,
            mag_ack_due: None,
            biases_due: None,
            network_due: None,
        }
    }

    pub(super) fn calibrate(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        now: Instant,
    ) -> Result<(), CommandError> {
        if self.update != Update::None {
            return Err(CommandError::Updating);
        }
        if self.calibration.is_some() {
            return Err(CommandError::Calibrating);
        }
        match kind {
            CalibrationKind::Imu => self.imu_taken = None,
            CalibrationKind::Magnetometer => self.mag_taken = None,
            CalibrationKind::Other(kind) => return Err(CommandError::CalibrationKind { kind }),
        }
        self.calibration = Some(Request::new(step, kind, now));
        Ok(())
    }

    pub(super) fn receive(&mut self, frame: &Frame, at: Instant) {
        let message = frame.message();
        if is_from_host(&message) == Some(true) {
            bump(&mut self.stats.misdirected);
            return;
        }
        self.heard(at);
        match message {
            Message::Pong(pong) => self.pong(pong, at),
            Message::CalibrationStartAck(ack) => {
                self.acknowledge(CalibrationStep::Start, ack.kind(), ack.err(), at);
            }
            Message::CalibrationEndAck(ack) => {
                self.acknowledge(CalibrationStep::End, ack.kind(), ack.err(), at);
            }
            Message::Report(report) => self.report(&report, frame.index()),
            Message::ImuBias(bias) => self.imu_result(*bias, at),
            Message::MagBias(bias) => self.mag_result(*bias, at),
            Message::BiasRequest(_) => self.bias_request(at),
            Message::OtaAck(ack) => self.update_answer(ack.status()),
            Message::Unknown(raw) => self.unknown(&raw),
            // Commands of a host, which have been refused above.
            _ => {}
        }
    }

    /// A valid frame of a robot has arrived.
    fn heard(&mut self, at: Instant) {
        self.link_until = Some(at + self.config.link_timeout);
        if self.link != Link::Up {
            self.link = Link::Up;
            self.events.push(HostEvent::LinkUp);
            self.network_due = self.network.map(|_| at);
        }
    }

    fn pong(&mut self, pong: &Pong, at: Instant) {
        let Some(round_trip) = self.ping.pong(at, &self.config) else {
            bump(&mut self.stats.pongs_unasked);
            return;
        };
        let err = pong.err();
        if err != ErrorCode::Fine {
            bump(&mut self.stats.pings_damaged);
        }
        self.stats.round_trip.add(round_trip);
        self.events.push(HostEvent::Pong { round_trip, err });
    }

    fn report(&mut self, report: &Report<'_>, index: u8) {
        let lost = match self.last_index.replace(index) {
            Some(last) if last == index => {
                bump(&mut self.stats.reports_repeated);
                0
            }
            Some(last) => index.wrapping_sub(last).wrapping_sub(1),
            None => 0,
        };
        bump(&mut self.stats.reports);
        self.stats.reports_lost = self.stats.reports_lost.saturating_add(lost.into());
        let report = ReceivedReport::new(report, index, lost);
        self.last_report = Some(report);
        self.events.push(HostEvent::Report(report));
    }

    fn acknowledge(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        err: ErrorCode,
        at: Instant,
    ) {
        let answer = match &mut self.calibration {
            Some(request) => request.acknowledge(step, kind, err, at, &self.config),
            None => Answer::Unasked,
        };
        match answer {
            Answer::Unasked => bump(&mut self.stats.acks_unasked),
            Answer::Again => {}
            Answer::Settled(event) => self.settle_calibration(event),
        }
    }

    fn settle_calibration(&mut self, event: HostEvent) {
        self.calibration = None;
        if matches!(event, HostEvent::CalibrationFailed(_)) {
            bump(&mut self.stats.calibration_failures);
        }
        self.events.push(event);
    }

    fn imu_result(&mut self, bias: ImuBias, at: Instant) {
        if self.imu_taken == Some(bias) {
            bump(&mut self.stats.results_repeated);
        } else if self.store.store_imu(bias).is_ok() {
            self.imu_taken = Some(bias);
            self.events.push(HostEvent::ImuBias(bias));
        } else {
            return self.not_stored(CalibrationKind::Imu);
        }
        self.imu_ack_due = Some(at);
    }

    fn mag_result(&mut self, bias: MagBias, at: Instant) {
        if self.mag_taken == Some(bias) {
            bump(&mut self.stats.results_repeated);
        } else if self.store.store_mag(bias).is_ok() {
            self.mag_taken = Some(bias);
            self.events.push(HostEvent::MagBias(bias));
        } else {
            return self.not_stored(CalibrationKind::Magnetometer);
        }
        self.mag_ack_due = Some(at);
    }

    fn not_stored(&mut self, kind: CalibrationKind) {
        bump(&mut self.stats.results_not_stored);
        self.events.push(HostEvent::BiasNotStored(kind));
    }

    /// The robot has booted, not more than a second ago or unanswered since.
    fn bias_request(&mut self, at: Instant) {
        bump(&mut self.stats.bias_requests);
        self.last_index = None;
        self.network_due = self.network.map(|_| at);
        match self.store.load() {
            (Some(imu), Some(mag)) => self.biases_due = Some((at, Biases::new(imu, mag))),
            (imu, mag) => {
                let (imu, mag) = (imu.is_none(), mag.is_none());
                self.events.push(HostEvent::BiasesMissing { imu, mag });
            }
        }
    }

    fn update_answer(&mut self, status: OtaStatus) {
        if self.update == Update::Silent && status != OtaStatus::Accepted {
            self.update = Update::None;
        }
        self.events.push(HostEvent::UpdateAnswered(status));
    }

    fn unknown(&mut self, frame: &RawFrame<'_>) {
        bump(&mut self.stats.unknown);
        if let Some(frame) = UnknownFrame::copy(frame) {
            self.events.push(HostEvent::Unknown(frame));
        }
    }

    pub(super) fn expire(&mut self, now: Instant) {
        self.expire_command(now);
        if reached(self.link_until, now) {
            self.link_until = None;
            self.link = Link::Down;
            self.last_index = None;
            bump(&mut self.stats.links_lost);
            self.events.push(HostEvent::LinkDown);
        }
        if self.ping.expire(now, &self.config) {
            bump(&mut self.stats.pings_lost);
        }
        let request = self.calibration.as_mut();
        if let Some(failure) = request.and_then(|request| request.expire(now, &self.config)) {
            self.settle_calibration(HostEvent::CalibrationFailed(failure));
        }
    }

    pub(super) fn expire_command(&mut self, now: Instant) {
        if self.motor.expire(now) {
            bump(&mut self.stats.dead_man);
            self.events.push(HostEvent::DeadMan);
        }
    }

    /// Writes the most urgent frame that is due and says how long it is.
    pub(super) fn fill(&mut self, buffer: &mut [u8; MAX_LEN], now: Instant) -> Option<usize> {
        let index = self.index;
        if self.update == Update::Silent {
            return None;
        }
        if let Some(command) = self.motor.take(now, &self.config) {
            bump(&mut self.stats.commands);
            return Some(write(command, index, buffer));
        }
        if self.imu_ack_due.take().is_some() {
            return Some(write(ImuBiasAck::new(ErrorCode::Fine), index, buffer));
        }
        if self.mag_ack_due.take().is_some() {
            return Some(write(MagBiasAck::new(ErrorCode::Fine), index, buffer));
        }
        if let Some((_, biases)) = self.biases_due.take() {
            self.events.push(HostEvent::BiasesSent);
            return Some(write(biases, index, buffer));
        }
        let request = self.calibration.as_mut();
        if let Some((step, kind, again)) =
            request.and_then(|request| request.take(now, &self.config))
        {
            if again {
                bump(&mut self.stats.calibration_retries);
            }
            return Some(match step {
                CalibrationStep::Start => write(CalibrationStart::new(kind), index, buffer),
                CalibrationStep::End => write(CalibrationEnd::new(kind), index, buffer),
            });
        }
        if let Some(body) = self.network.filter(|_| self.network_due.take().is_some()) {
            return Some(write(body, index, buffer));
        }
        if let Update::Asked { version, .. } = self.update {
            self.update = Update::Silent;
            self.motor.pause();
            return Some(write(OtaRequest::start_firmware_update(version), index, buffer));
        }
        if self.ping.take(now, &self.config) {
            bump(&mut self.stats.pings);
            return Some(write(ucp::Ping {}, index, buffer));
        }
        None
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        if self.update == Update::Silent {
            return self.link_until;
        }
        let asked = match self.update {
            Update::Asked { at, .. } => Some(at),
            _ => None,
        };
        [
            self.link_until,
            self.motor.deadline(),
            self.ping.deadline(),
            self.calibration.as_ref().map(Request::deadline),
            self.imu_ack_due,
            self.mag_ack_due,
            self.biases_due.map(|(at, _)| at),
            self.network_due,
            asked,
        ]
        .into_iter()
        .flatten()
        .min()
    }
}
