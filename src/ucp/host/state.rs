//! State of a host.

use super::{
    bias::BiasStore,
    calibration::{Answer, Request},
    config::HostConfig,
    event::{
        CalibrationFailure, CalibrationStep, CommandError, HostEvent, ReceivedReport, UnknownFrame,
    },
    link::Link,
    motor::Motor,
    outgoing::Outgoing,
    ping::PingState,
    results::Results,
    standstill::{COAST, StopProgress, Wheels, are_still, may_be_a_restart},
    statistics::HostStatistics,
    update::Update,
};
use crate::{
    events::Events,
    stats::count,
    time::{Duration, Instant, reached, wire_time},
    ucp::{
        body::{ImuBias, MagBias, Pong, SetNetworkState},
        codes::{CalibrationKind, ErrorCode, NetworkState},
        frame::{Frame, RawFrame},
        message::Message,
        report::Report,
    },
};

/// Everything except the bytes.
#[derive(Clone, Debug)]
pub(super) struct State<S> {
    pub(super) config: HostConfig,
    pub(super) store: S,
    pub(super) events: Events<HostEvent, 16>,
    pub(super) stats: HostStatistics,
    /// Counter of the next frame.
    pub(super) index: u8,
    pub(super) link: Link,
    /// Time at which the link goes down.
    pub(super) link_until: Option<Instant>,
    pub(super) motor: Motor,
    pub(super) ping: PingState,
    pub(super) calibration: Option<Request>,
    /// The calibration that the robot was last told to start; `None` if unknown.
    last_start: Option<CalibrationKind>,
    /// Outcome of a calibration request, while there is no room for its event.
    outcome: Option<HostEvent>,
    /// Outcome of the latest calibration request.
    pub(super) settled: Option<Result<(), CalibrationFailure>>,
    pub(super) update: Update,
    pub(super) network: Option<SetNetworkState>,
    pub(super) last_report: Option<ReceivedReport>,
    /// Whether the latest report has not been taken.
    pub(super) is_report_new: bool,
    /// Round trip of the latest pong, until it is taken.
    pub(super) new_round_trip: Option<Duration>,
    /// When the latest report arrived, if there is one, and its index.
    reported_at: Instant,
    reported_index: u8,
    /// Until when the wheels of a robot that may have restarted may coast.
    coasts_until: Instant,
    /// Index of the previous report, if there is one to count from.
    last_index: Option<u8>,
    pub(super) imu: Results<ImuBias>,
    pub(super) mag: Results<MagBias>,
    /// Time since which biases are due.
    pub(super) biases_due: Option<Instant>,
    /// Whether the application has been told that the biases are sent.
    pub(super) biases_told: bool,
    pub(super) network_due: Option<Instant>,
    /// The frame handed out last, while it may still come back.
    pub(super) last: Option<Outgoing>,
    /// While bytes are taken in: the earliest time at which they can have arrived.
    pub(super) arrived_since: Option<Instant>,
    /// The port has taken all of the last frame.
    pub(super) is_last_taken: bool,
    /// The link timeout has passed, or that of an update request that waits for its port, but what
    /// has been received may not have been taken in.
    pub(super) is_overdue: bool,
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
            motor: Motor::new(now, &config),
            ping: PingState::new(now, &config),
            calibration: None,
            last_start: None,
            outcome: None,
            settled: None,
            update: Update::None,
            network: None,
            last_report: None,
            is_report_new: false,
            new_round_trip: None,
            reported_at: now,
            reported_index: 0,
            coasts_until: now,
            last_index: None,
            imu: Results::new(),
            mag: Results::new(),
            biases_due: None,
            biases_told: false,
            network_due: None,
            last: None,
            arrived_since: None,
            is_last_taken: false,
            is_overdue: false,
        }
    }

    pub(super) fn calibrate(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        now: Instant,
    ) -> Result<(), CommandError> {
        if !self.update.is_none() {
            return Err(CommandError::Updating);
        }
        if self.is_calibrating() {
            return Err(CommandError::Calibrating);
        }
        match (kind, step) {
            (CalibrationKind::Other(kind), _) => {
                return Err(CommandError::CalibrationKind { kind });
            }
            (CalibrationKind::Imu, CalibrationStep::Start) => self.imu.begin(),
            (CalibrationKind::Magnetometer, CalibrationStep::Start) => self.mag.begin(),
            // A result that has already arrived is the one reported.
            (_, CalibrationStep::End) => {}
        }
        let request = Request::new(step, kind, self.last_start, now);
        (self.calibration, self.settled) = (Some(request), None);
        Ok(())
    }

    /// Whether a request is unanswered, or its outcome not yet reported.
    pub(super) const fn is_calibrating(&self) -> bool {
        self.calibration.is_some() || self.outcome.is_some()
    }

    pub(super) fn show(&mut self, network: NetworkState, now: Instant) -> Result<(), CommandError> {
        let body = SetNetworkState::new(network).map_err(CommandError::Value)?;
        self.allow(0x0A)?;
        if self.network.replace(body) != Some(body) {
            self.network_due = Some(now);
        }
        Ok(())
    }

    pub(super) fn start_update(&mut self, version: i16, at: Instant) -> Result<(), CommandError> {
        self.allow(9)?;
        if !self.update.is_none() {
            return Err(CommandError::Updating);
        }
        if self.is_calibrating() {
            return Err(CommandError::Calibrating);
        }
        if self.link == Link::Down {
            return Err(CommandError::LinkDown);
        }
        self.motor.standstill().expire(at);
        if self.motor.stop_progress() != StopProgress::StandingStill {
            return Err(CommandError::Moving);
        }
        // A robot that is being updated hears no stop, so a damaged stop must not be enough to
        // update it while it drives.
        self.motor.repeat(at);
        self.update = Update::Asked { version, at };
        Ok(())
    }

    /// Leaves the line to the update that was asked for.
    pub(super) const fn begin_update(&mut self, now: Instant) {
        self.update = Update::Silent { since: now };
        self.is_overdue = false;
        self.motor.pause();
    }

    /// Ends an update: the line is the host's again.
    pub(super) fn end_update(&mut self, now: Instant) {
        self.update = Update::None;
        self.motor.resume(now);
        self.ping.resume(now);
        // Anything that the robot requested during the silence is due now.
        let dues = [
            &mut self.imu.ack_due,
            &mut self.mag.ack_due,
            &mut self.biases_due,
            &mut self.network_due,
        ];
        dues.into_iter().flatten().for_each(|at| *at = now.max(*at));
    }

    /// Checks whether a frame with this id, one of 5..=0x0A, may be sent (ruling U14).
    const fn allow(&self, id: u8) -> Result<(), CommandError> {
        if self.config.low_ids_only { Err(CommandError::LowIdsOnly { id }) } else { Ok(()) }
    }

    pub(super) fn pop_event(&mut self) -> Option<HostEvent> {
        let event = self.events.pop();
        self.use_room();
        event
    }

    pub(super) fn retain_events(&mut self, mut stays: impl FnMut(&HostEvent) -> bool) {
        self.events.retain(&mut stays);
        self.outcome = self.outcome.take().filter(stays);
        self.use_room();
    }

    /// Reports an outcome that has been waiting for room.
    fn use_room(&mut self) {
        if let Some(outcome) = self.outcome.take() {
            self.outcome = self.events.keep(outcome).err();
        }
    }

    pub(super) fn receive(&mut self, frame: &Frame, at: Instant) {
        let message = frame.message();
        if message.is_from_host() == Some(true) {
            count(&mut self.stats.misdirected);
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
            Message::Report(report) => self.report(&report, frame, at),
            Message::ImuBias(bias) => self.imu_result(*bias, at),
            Message::MagBias(bias) => self.mag_result(*bias, at),
            Message::BiasRequest(_) => self.bias_request(at),
            Message::OtaAck(ack) => {
                let is_answer = |event: &HostEvent| matches!(event, HostEvent::UpdateAnswered(_));
                self.events.push_latest(HostEvent::UpdateAnswered(ack.status()), is_answer);
            }
            // Unknown, or a message that a host has no use for. Commands were refused above.
            _ => self.unknown(frame),
        }
    }

    /// Records that a valid frame of a robot has arrived.
    fn heard(&mut self, at: Instant) {
        self.link_until = Some(at + self.config.link_timeout);
        self.is_overdue = false;
        if self.link != Link::Up {
            self.link = Link::Up;
            self.events.push_latest(HostEvent::LinkUp, is_link);
            self.network_due = self.network.map(|_| at);
        }
    }

    fn pong(&mut self, pong: &Pong, at: Instant) {
        let Some(round_trip) = self.ping.pong(at, &self.config) else {
            count(&mut self.stats.pongs_unasked);
            return;
        };
        let err = pong.err();
        if err != ErrorCode::Fine {
            count(&mut self.stats.pings_damaged);
        }
        self.stats.round_trip.add(round_trip);
        self.new_round_trip = Some(round_trip);
        self.events.push_frequent(HostEvent::Pong { round_trip, err });
    }

    fn report(&mut self, report: &Report<'_>, frame: &Frame, at: Instant) {
        let index = frame.index();
        let lost = match self.last_index.replace(index) {
            Some(last) if last == index => {
                count(&mut self.stats.reports_repeated);
                0
            }
            Some(last) => index.wrapping_sub(last).wrapping_sub(1),
            None => 0,
        };
        count(&mut self.stats.reports);
        self.stats.reports_lost = self.stats.reports_lost.saturating_add(lost.into());
        let report = ReceivedReport::new(report, index, lost);
        let since = self.arrived_since.map_or(at, |since| at.min(since));
        // A vendor robot that has restarted reports 0 until its next move, whatever its wheels do.
        let (pause, steps) = (since - self.reported_at, index.wrapping_sub(self.reported_index));
        let is_in_doubt = pause >= self.config.link_timeout || may_be_a_restart(pause, steps);
        if !are_still(&report.telemetry.rpm) {
            self.coasts_until = at;
        } else if self.stats.reports > 1 && is_in_doubt {
            self.coasts_until = at + COAST;
        }
        (self.reported_at, self.reported_index) = (at, index);
        let at = since;
        self.motor.standstill().report(&Wheels {
            rpm: report.telemetry.rpm,
            at,
            on_line: wire_time(frame.as_bytes().len(), self.config.baud),
            average: self.config.rpm_average,
            shows_from: self.coasts_until,
            until: at + self.config.link_timeout,
        });
        (self.last_report, self.is_report_new) = (Some(report), true);
        self.events.push_frequent(HostEvent::Report(report));
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
            Answer::Unasked => count(&mut self.stats.acks_unasked),
            Answer::Again => {}
            Answer::Settled(event) => self.settle_calibration(event),
        }
    }

    fn settle_calibration(&mut self, event: HostEvent) {
        self.calibration = None;
        self.settled = Some(match event {
            HostEvent::CalibrationFailed(failure) => {
                count(&mut self.stats.calibration_failures);
                if failure.step == CalibrationStep::Start {
                    // The start may have arrived anyway.
                    self.last_start = None;
                }
                Err(failure)
            }
            HostEvent::CalibrationStarted(kind) => {
                self.last_start = Some(kind);
                Ok(())
            }
            _ => Ok(()),
        });
        // Without room it waits, and until then no other request is accepted.
        self.outcome = self.events.keep(event).err();
    }

    fn imu_result(&mut self, bias: ImuBias, at: Instant) {
        if self.imu.is_repetition(&bias) {
            count(&mut self.stats.results_repeated);
        } else if self.store.store_imu(bias).is_err() {
            self.imu.refuse();
            return self.not_stored(CalibrationKind::Imu);
        } else if !self.is_kept(HostEvent::ImuBias(bias)) {
            return self.imu.refuse();
        }
        let ack_due = self.allow(6).is_ok().then_some(at);
        self.imu.accept(bias, ack_due);
    }

    fn mag_result(&mut self, bias: MagBias, at: Instant) {
        if self.mag.is_repetition(&bias) {
            count(&mut self.stats.results_repeated);
        } else if self.store.store_mag(bias).is_err() {
            self.mag.refuse();
            return self.not_stored(CalibrationKind::Magnetometer);
        } else if !self.is_kept(HostEvent::MagBias(bias)) {
            return self.mag.refuse();
        }
        let ack_due = self.allow(7).is_ok().then_some(at);
        self.mag.accept(bias, ack_due);
    }

    /// Reports a result that the store has accepted; returns whether the application will find it
    /// (ruling U15).
    fn is_kept(&mut self, event: HostEvent) -> bool {
        if self.store.keeps() {
            self.events.push(event);
            return true;
        }
        let kept = self.events.keep(event).is_ok();
        if !kept {
            count(&mut self.stats.results_without_room);
        }
        kept
    }

    fn not_stored(&mut self, kind: CalibrationKind) {
        count(&mut self.stats.results_not_stored);
        self.events.push_frequent(HostEvent::BiasNotStored(kind));
    }

    /// Handles a request for biases: the robot has booted within the last second, or has not been
    /// answered since.
    fn bias_request(&mut self, at: Instant) {
        count(&mut self.stats.bias_requests);
        self.last_index = None;
        self.network_due = self.network.map(|_| at);
        if self.allow(8).is_ok() {
            // The biases are chosen when they are sent: better ones may be on their way.
            self.biases_due = Some(at);
            self.biases_told = false;
        } else {
            self.events.push_frequent(HostEvent::BiasesNotAnswered);
        }
    }

    fn unknown(&mut self, frame: &Frame) {
        count(&mut self.stats.unknown);
        let raw = RawFrame { id: frame.id(), index: frame.index(), body: frame.body() };
        if let Some(frame) = UnknownFrame::copy(&raw) {
            self.events.push_frequent(HostEvent::Unknown(frame));
        }
    }

    pub(super) fn expire(&mut self, now: Instant) {
        self.expire_command(now);
        if self.ping.expire(now, &self.config) {
            count(&mut self.stats.pings_lost);
        }
        let request = self.calibration.as_mut();
        if let Some(failure) = request.and_then(|request| request.expire(now, &self.config)) {
            self.settle_calibration(HostEvent::CalibrationFailed(failure));
        }
    }

    /// Ends a command whose application has gone silent (U10), and notes that what was decided
    /// because of reports may no longer hold.
    pub(super) fn expire_dead_man(&mut self, now: Instant) {
        self.is_overdue = match self.update.is_silent() {
            true => reached(self.update.overdue_at(), now),
            false => reached(self.link_until, now),
        };
        if self.motor.expire(now) {
            count(&mut self.stats.dead_man);
            self.events.push(HostEvent::DeadMan);
        }
    }

    /// Ends an update whose request was not sent.
    pub(super) fn give_up_update(&mut self, now: Instant) {
        self.end_update(now);
        self.events.push(HostEvent::UpdateNotSent);
    }

    /// Ends a command whose application has gone silent, or whose robot is no longer heard (U10).
    pub(super) fn expire_command(&mut self, now: Instant) {
        self.expire_dead_man(now);
        if reached(self.link_until, now) {
            (self.link, self.link_until) = (Link::Down, None);
            self.last_index = None;
            self.motor.lose_link(now);
            count(&mut self.stats.links_lost);
            self.events.push_latest(HostEvent::LinkDown, is_link);
        }
    }
}

fn is_link(event: &HostEvent) -> bool {
    matches!(event, HostEvent::LinkUp | HostEvent::LinkDown)
}
