//! State of a robot.

use super::{
    config::RobotConfig,
    event::{RobotEvent, UpdateSource},
    outgoing::{Answers, Outgoing},
    repeat::{Cadence, Repeat},
    statistics::RobotStatistics,
};
use crate::{
    events::Events,
    stats::count,
    time::{Instant, reached},
    ucp::{
        body::{BiasRequest, Biases, ImuBias, MagBias},
        codes::{CalibrationKind, ErrorCode, NetworkState, OtaStatus},
        frame::Frame,
        message::Message,
        motor::{MotorControl, RawMotorControl},
        report::Telemetry,
        update::RawOtaRequest,
    },
};

/// Everything except the bytes.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) config: RobotConfig,
    pub(super) events: Events<RobotEvent, 18, 2>,
    pub(super) stats: RobotStatistics,
    pub(super) command: MotorControl,
    /// Whether the command has changed since it was taken.
    pub(super) is_command_new: bool,
    /// Time at which the command is too old; `None` while the robot stands still for lack of one.
    pub(super) command_until: Option<Instant>,
    pub(super) answers: Answers,
    /// Counter of the next report.
    pub(super) index: u8,
    pub(super) telemetry: Telemetry,
    pub(super) reports: Cadence,
    calibration: Option<Calibration>,
    pub(super) imu_result: Repeat<ImuBias>,
    pub(super) mag_result: Repeat<MagBias>,
    pub(super) bias_request: Repeat<BiasRequest>,
    pub(super) network: Option<NetworkState>,
    pub(super) update_asked: bool,
    /// The frame handed out last, while it may still come back.
    pub(super) last: Option<Outgoing>,
    /// The port has taken all of it.
    pub(super) is_last_taken: bool,
    /// The answer to an update, until it has been flushed; and until when a failed flush can be
    /// its own, if the port was not said to have taken it.
    pub(super) update_answer: Option<(OtaStatus, Option<Instant>)>,
}

/// A running calibration.
#[derive(Clone, Copy, Debug)]
struct Calibration {
    kind: CalibrationKind,
    /// Whether its result has been handed in: the acknowledgement of the result ends it.
    has_result: bool,
}

impl State {
    pub(super) fn new(config: RobotConfig, now: Instant) -> Self {
        Self {
            config,
            events: Events::new(),
            stats: RobotStatistics::default(),
            command: MotorControl::STOP,
            is_command_new: false,
            command_until: None,
            answers: Answers::default(),
            index: 0,
            telemetry: Telemetry::default(),
            reports: Cadence::default(),
            calibration: None,
            imu_result: Repeat::new(None),
            mag_result: Repeat::new(None),
            bias_request: Repeat::new(config.bias_request_period.map(|_| (BiasRequest {}, now))),
            network: None,
            update_asked: false,
            last: None,
            is_last_taken: false,
            update_answer: None,
        }
    }

    pub(super) fn calibrating(&self) -> Option<CalibrationKind> {
        self.calibration.map(|calibration| calibration.kind)
    }

    pub(super) fn abort_calibration(&mut self) -> Option<CalibrationKind> {
        self.calibration.take().map(|calibration| calibration.kind)
    }

    pub(super) fn begin_imu_result(&mut self, bias: ImuBias, now: Instant) {
        self.imu_result.begin(bias, now);
        self.has_result(CalibrationKind::Imu);
    }

    pub(super) fn begin_mag_result(&mut self, bias: MagBias, now: Instant) {
        self.mag_result.begin(bias, now);
        self.has_result(CalibrationKind::Magnetometer);
    }

    fn has_result(&mut self, kind: CalibrationKind) {
        if let Some(calibration) = self.calibration.as_mut().filter(|it| it.kind == kind) {
            calibration.has_result = true;
        }
    }

    pub(super) fn answer_update(&mut self, status: OtaStatus, now: Instant) -> bool {
        let asked = core::mem::take(&mut self.update_asked);
        if asked {
            self.answers.update = Some(status);
            self.answers.ask(now);
        }
        asked
    }

    /// Processes a frame that arrived at `at`.
    pub(super) fn receive(&mut self, frame: &Frame, at: Instant, now: Instant) {
        let message = frame.message();
        if message.is_from_host() == Some(false) {
            count(&mut self.stats.misdirected);
            return;
        }
        match message {
            Message::Ping(_) => {
                count(&mut self.stats.pings);
                self.answers.pong = true;
                self.answers.ask(at);
            }
            Message::MotorControl(command) => self.motor(command, at, now),
            Message::CalibrationStart(start) => self.calibration_start(start.kind(), at),
            Message::CalibrationEnd(end) => self.calibration_end(end.kind(), at),
            Message::ImuBiasAck(ack) => self.imu_ack(ack.err()),
            Message::MagBiasAck(ack) => self.mag_ack(ack.err()),
            Message::Biases(biases) => self.biases(*biases),
            Message::OtaRequest(request) => self.update_request(request),
            Message::SetNetworkState(body) => self.network_state(body.state()),
            Message::SetNetworkStateWide(body) => self.network_state(body.state()),
            // Unknown, or a message that a robot has no use for. Reports were refused above.
            _ => count(&mut self.stats.unknown),
        }
    }

    fn motor(&mut self, received: &RawMotorControl, at: Instant, now: Instant) {
        if received.starts_update() {
            count(&mut self.stats.commands_refused);
            let (version, by) = (received.version().cast_signed(), UpdateSource::MotorCommand);
            if !self.tell_update(RobotEvent::UpdateRequested { version, by }) {
                count(&mut self.stats.without_room);
            }
            return;
        }
        // A command that comes too late does not hide that the robot had to stop.
        self.watch(at);
        let mut command = clamped(received);
        if (command.speed(), command.angular()) != (received.speed(), received.angular()) {
            count(&mut self.stats.commands_clamped);
        }
        count(&mut self.stats.commands);
        let resumed = self.command_until.is_none();
        self.command_until = Some(at + self.config.watchdog);
        if reached(self.command_until, now) {
            // Already too old: it moves nothing, and is not reported as a moving command.
            command = command.halted();
        }
        if resumed || command != self.command {
            (self.command, self.is_command_new) = (command, true);
            self.events.push_latest(RobotEvent::Motor(command), is_motion);
        }
    }

    /// Stops the robot when the command is too old. One that the application has not been told yet
    /// is no longer told as one that moves: it must not begin to move.
    pub(super) fn watch(&mut self, now: Instant) {
        if reached(self.command_until, now) {
            self.command_until = None;
            (self.command, self.is_command_new) = (self.command.halted(), true);
            count(&mut self.stats.watchdog);
            self.events.amend(|event| {
                if let RobotEvent::Motor(command) = event {
                    *command = command.halted();
                }
            });
            self.events.push_latest(RobotEvent::Watchdog, is_motion);
        }
    }

    fn calibration_start(&mut self, kind: CalibrationKind, at: Instant) {
        if matches!(kind, CalibrationKind::Other(_)) {
            count(&mut self.stats.calibration_refused);
        } else {
            let repeated = self.calibrating() == Some(kind);
            if !self.tell_start(kind, repeated) {
                count(&mut self.stats.without_room);
                return;
            }
            if repeated {
                count(&mut self.stats.calibration_repeats);
            }
            self.calibration = Some(Calibration { kind, has_result: false });
        }
        self.answers.calibration_start = Some(kind);
        self.answers.ask(at);
    }

    /// Reports a start. If the previous start still waits in the queue, a repetition needs no
    /// event.
    fn tell_start(&mut self, kind: CalibrationKind, repeated: bool) -> bool {
        let waits = match self.events.newest(is_calibration) {
            Some(RobotEvent::CalibrationStart { kind: waiting, .. }) => *waiting == kind,
            _ => false,
        };
        let event = RobotEvent::CalibrationStart { kind, repeated };
        (repeated && waits) || self.events.keep(event).is_ok()
    }

    fn calibration_end(&mut self, kind: CalibrationKind, at: Instant) {
        if self.calibrating() != Some(kind) {
            count(&mut self.stats.calibration_refused);
        } else if self.events.keep(RobotEvent::CalibrationEnd(kind)).is_ok() {
            self.calibration = None;
        } else {
            count(&mut self.stats.without_room);
            return;
        }
        self.answers.calibration_end = Some(kind);
        self.answers.ask(at);
    }

    fn imu_ack(&mut self, err: ErrorCode) {
        let asked = self.imu_result.was_sent();
        if self.is_taken(asked, err, RobotEvent::ImuBiasTaken, CalibrationKind::Imu) {
            self.imu_result.end();
        }
    }

    fn mag_ack(&mut self, err: ErrorCode) {
        let asked = self.mag_result.was_sent();
        if self.is_taken(asked, err, RobotEvent::MagBiasTaken, CalibrationKind::Magnetometer) {
            self.mag_result.end();
        }
    }

    /// Handles the host's acknowledgement of a result: reports it, and ends the result's
    /// calibration.
    fn is_taken(
        &mut self,
        asked: bool,
        err: ErrorCode,
        event: RobotEvent,
        kind: CalibrationKind,
    ) -> bool {
        if !asked || err != ErrorCode::Fine {
            count(&mut self.stats.acks_refused);
            return false;
        }
        if self.events.keep(event).is_err() {
            count(&mut self.stats.without_room);
            return false;
        }
        self.calibration = self.calibration.filter(|it| it.kind != kind || !it.has_result);
        true
    }

    fn biases(&mut self, biases: Biases) {
        let event = RobotEvent::Biases(biases);
        let waits = |event: &RobotEvent| matches!(event, RobotEvent::Biases(_));
        if self.events.newest(waits) == Some(&event) || self.events.keep(event).is_ok() {
            self.bias_request.end();
        } else {
            count(&mut self.stats.without_room);
        }
    }

    fn update_request(&mut self, request: &RawOtaRequest) {
        let (version, by) = (request.version(), UpdateSource::Request);
        if self.tell_update(RobotEvent::UpdateRequested { version, by }) {
            self.update_asked = true;
        } else {
            count(&mut self.stats.without_room);
        }
    }

    /// Reports an update request. If the same request still waits in the queue, it needs no event.
    fn tell_update(&mut self, event: RobotEvent) -> bool {
        let waits = |event: &RobotEvent| matches!(event, RobotEvent::UpdateRequested { .. });
        self.events.newest(waits) == Some(&event) || self.events.keep(event).is_ok()
    }

    fn network_state(&mut self, state: NetworkState) {
        self.network = Some(state);
        let is_network = |event: &RobotEvent| matches!(event, RobotEvent::NetworkState(_));
        self.events.push_latest(RobotEvent::NetworkState(state), is_network);
    }
}

const fn is_motion(event: &RobotEvent) -> bool {
    matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog)
}

const fn is_calibration(event: &RobotEvent) -> bool {
    matches!(event, RobotEvent::CalibrationStart { .. } | RobotEvent::CalibrationEnd(_))
}

/// The command clamped to -100..=100, its lamp on or off as the vendor firmware reads it.
fn clamped(command: &RawMotorControl) -> MotorControl {
    let limit = MotorControl::LIMIT;
    MotorControl::new(command.speed().clamp(-limit, limit), command.angular().clamp(-limit, limit))
        .unwrap_or(MotorControl::STOP)
        .with_front_led(command.lamp_is_on())
}
