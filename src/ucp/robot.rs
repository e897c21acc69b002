//! The robot's side: takes commands, reports, calibrates.

mod config;
mod event;
mod repeat;

pub use config::{ReportLayout, RobotConfig};
pub use event::{RobotEvent, RobotStatistics, UpdateSource};

use super::{
    BiasRequest, CalibrationEndAck, CalibrationKind, CalibrationStartAck, DocumentReport,
    ErrorCode, FirmwareReport, Frame, ImuBias, MAX_LEN, MagBias, Message, MotorControl, OtaAck,
    OtaStatus, Pong, Telemetry,
    role::{Events, Inbox, bump, halted, is_from_host, lamp_is_on, reached, write},
};
use crate::{endpoint::Endpoint, stream::Counters, time::Instant};
use repeat::{Cadence, Repeat};

/// A rover, as its host sees it: a pure state machine, driven as [`Endpoint`] says.
///
/// * **Commands (U10).** A valid command holds for 500 ms, then speed and turn are 0 until the next.
///   Only a valid command counts: the vendor firmware is content with any byte, and drives on through
///   noise. Out of range is cut to -100..=100, as the vendor firmware does: who sends 360 means all
///   there is, and to refuse would leave the command before in force, which nobody wants any more.
/// * **Pings (U12).** Answered at once, and always with 0. The robot never says 1: a damaged frame is
///   refused before anyone knows that it was a ping. The host sees a lost ping.
/// * **Reports (U9, U10).** Every 20 ms from the first [`set_telemetry`](Self::set_telemetry) on, one
///   period after the one before; a robot that was held up skips what it missed. `index` counts the
///   reports that were sent. All other frames have index 0, as shipped robots send them.
/// * **Calibration (U11).** Requests are acknowledged at once. Results are sent every 1000 ms until
///   acknowledged, and so is the request for biases, from the first moment until it is answered.
/// * **Firmware update (U7).** Never starts by itself: it is an event, and the application decides.
/// * **Frames that only a robot sends (U13)** are counted and ignored. Shipped robots hang on id 5.
///
/// ```
/// use axlewire::{endpoint::Endpoint, time::Instant};
/// use axlewire::ucp::{Body, MotorControl, Robot, RobotConfig};
///
/// let mut robot = Robot::new(RobotConfig::default(), Instant::from_millis(0));
/// let received = MotorControl::new(60, 0)?.frame(0);
/// robot.handle_input(received.as_bytes(), Instant::from_millis(10));
/// assert_eq!(robot.command(Instant::from_millis(509)).speed(), 60);
/// assert_eq!(robot.command(Instant::from_millis(510)).speed(), 0);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Robot {
    inbox: Inbox,
    outgoing: [u8; MAX_LEN],
    state: State,
}

impl Robot {
    /// A robot that has just booted: it stands still and asks for its biases.
    #[must_use]
    pub fn new(config: RobotConfig, now: Instant) -> Self {
        let config = config.sane();
        Self {
            inbox: Inbox::new(config.baud, config.quiet_margin),
            outgoing: [0; MAX_LEN],
            state: State::new(config, now),
        }
    }

    /// What to do at this moment: the latest command, or standing still if it is too old.
    ///
    /// Right at any time, whether or not events have been taken out and timeouts handled.
    #[must_use]
    pub fn command(&self, now: Instant) -> MotorControl {
        let State { command, command_until, .. } = &self.state;
        if reached(*command_until, now) { halted(command) } else { *command }
    }

    /// What the next reports say. The first call starts them: nothing is reported unmeasured.
    pub fn set_telemetry(&mut self, telemetry: &Telemetry, now: Instant) {
        self.state.telemetry = *telemetry;
        self.state.reports.begin(now);
    }

    /// Sends the result of an IMU calibration until the host has it, in place of one still unsent.
    ///
    /// An acknowledgement does not say of which result: one still on its way for the result before
    /// counts for this one.
    pub fn calibration_result_imu(&mut self, bias: ImuBias, now: Instant) {
        self.state.imu_result.begin(bias, now);
    }

    /// Sends the result of a magnetometer calibration until the host has it, likewise.
    pub fn calibration_result_mag(&mut self, bias: MagBias, now: Instant) {
        self.state.mag_result.begin(bias, now);
    }

    /// Answers the host's request to update the firmware; `false` if none is unanswered.
    ///
    /// To update is up to the application: behind [`OtaStatus::Accepted`] it takes the port away from
    /// this role.
    pub fn answer_update(&mut self, status: OtaStatus, now: Instant) -> bool {
        let asked = core::mem::take(&mut self.state.update_asked);
        if asked {
            self.state.answers.update = Some(status);
            self.state.answers.ask(now);
        }
        asked
    }

    /// What is being calibrated.
    #[must_use]
    pub const fn calibrating(&self) -> Option<CalibrationKind> {
        self.state.calibrating
    }

    /// What the robot has seen.
    #[must_use]
    pub const fn statistics(&self) -> &RobotStatistics {
        &self.state.stats
    }

    /// Where every received byte went.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.inbox.counters()
    }

    /// Events refused because nobody took the older ones out.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.state.events.lost()
    }
}

impl Endpoint for Robot {
    type Event = RobotEvent;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        let Self { inbox, state, .. } = self;
        inbox.take(bytes, now, |frame, at| state.receive(frame, at));
    }

    fn handle_timeout(&mut self, now: Instant) {
        let Self { inbox, state, .. } = self;
        inbox.settle(now, |frame, at| state.receive(frame, at));
        state.watch(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let len = self.state.fill(&mut self.outgoing, now)?;
        self.outgoing.get(..len)
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.state.events.pop()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        [self.inbox.deadline(), self.state.deadline()].into_iter().flatten().min()
    }
}

/// Everything but the bytes.
#[derive(Debug)]
struct State {
    config: RobotConfig,
    events: Events<RobotEvent, 16>,
    stats: RobotStatistics,
    command: MotorControl,
    /// When the command is too old; `None` while the robot stands still for want of one.
    command_until: Option<Instant>,
    answers: Answers,
    /// Counter of the next report.
    index: u8,
    telemetry: Telemetry,
    reports: Cadence,
    calibrating: Option<CalibrationKind>,
    imu_result: Repeat<ImuBias>,
    mag_result: Repeat<MagBias>,
    bias_request: Repeat<BiasRequest>,
    update_asked: bool,
}

/// Answers to be sent: the latest of each sort, however often the host asks.
#[derive(Debug, Default)]
struct Answers {
    pong: bool,
    calibration_start: Option<CalibrationKind>,
    calibration_end: Option<CalibrationKind>,
    update: Option<OtaStatus>,
    /// When the oldest was asked for.
    since: Option<Instant>,
}

impl Answers {
    fn ask(&mut self, at: Instant) {
        self.since.get_or_insert(at);
    }
}

impl State {
    fn new(config: RobotConfig, now: Instant) -> Self {
        Self {
            config,
            events: Events::new(),
            stats: RobotStatistics::default(),
            command: MotorControl::STOP,
            command_until: None,
            answers: Answers::default(),
            index: 0,
            telemetry: Telemetry::default(),
            reports: Cadence::default(),
            calibrating: None,
            imu_result: Repeat::new(None),
            mag_result: Repeat::new(None),
            bias_request: Repeat::new(config.bias_request_period.map(|_| (BiasRequest {}, now))),
            update_asked: false,
        }
    }

    fn receive(&mut self, frame: &Frame, at: Instant) {
        let message = frame.message();
        if is_from_host(&message) == Some(false) {
            bump(&mut self.stats.misdirected);
            return;
        }
        match message {
            Message::Ping(_) => {
                bump(&mut self.stats.pings);
                self.answers.pong = true;
                self.answers.ask(at);
            }
            Message::MotorControl(command) => self.motor(command, at),
            Message::CalibrationStart(start) => self.calibration_start(start.kind(), at),
            Message::CalibrationEnd(end) => self.calibration_end(end.kind(), at),
            Message::ImuBiasAck(ack) => {
                let taken = ack.err() == ErrorCode::Fine && self.imu_result.end();
                self.result_taken(taken, RobotEvent::ImuBiasTaken);
            }
            Message::MagBiasAck(ack) => {
                let taken = ack.err() == ErrorCode::Fine && self.mag_result.end();
                self.result_taken(taken, RobotEvent::MagBiasTaken);
            }
            Message::Biases(biases) => {
                self.bias_request.end();
                self.events.push(RobotEvent::Biases(*biases));
            }
            Message::OtaRequest(request) => {
                self.update_asked = true;
                let (version, by) = (request.version(), UpdateSource::Request);
                self.events.push(RobotEvent::UpdateRequested { version, by });
            }
            Message::SetNetworkState(body) => {
                self.events.push(RobotEvent::NetworkState(body.state()));
            }
            Message::SetNetworkStateWide(body) => {
                self.events.push(RobotEvent::NetworkState(body.state()));
            }
            Message::Unknown(_) => bump(&mut self.stats.unknown),
            // Frames of a robot, which have been refused above.
            _ => {}
        }
    }

    fn motor(&mut self, received: &MotorControl, at: Instant) {
        if received.starts_update() {
            bump(&mut self.stats.commands_refused);
            let (version, by) = (received.version().cast_signed(), UpdateSource::MotorCommand);
            self.events.push(RobotEvent::UpdateRequested { version, by });
            return;
        }
        // A command that comes too late does not hide that the robot had to stop.
        self.watch(at);
        let command = clamped(received);
        if (command.speed(), command.angular()) != (received.speed(), received.angular()) {
            bump(&mut self.stats.commands_clamped);
        }
        bump(&mut self.stats.commands);
        let resumed = self.command_until.is_none();
        self.command_until = Some(at + self.config.command_timeout);
        if resumed || command != self.command {
            self.command = command;
            self.events.push(RobotEvent::Motor(command));
        }
    }

    /// Stops when the command has become too old.
    fn watch(&mut self, now: Instant) {
        if reached(self.command_until, now) {
            self.command_until = None;
            self.command = halted(&self.command);
            bump(&mut self.stats.watchdog_stops);
            self.events.push(RobotEvent::WatchdogStop);
        }
    }

    fn calibration_start(&mut self, kind: CalibrationKind, at: Instant) {
        self.answers.calibration_start = Some(kind);
        self.answers.ask(at);
        if matches!(kind, CalibrationKind::Other(_)) {
            bump(&mut self.stats.calibration_refused);
        } else if self.calibrating.replace(kind) == Some(kind) {
            bump(&mut self.stats.calibration_repeats);
        } else {
            self.events.push(RobotEvent::CalibrationStart(kind));
        }
    }

    fn calibration_end(&mut self, kind: CalibrationKind, at: Instant) {
        self.answers.calibration_end = Some(kind);
        self.answers.ask(at);
        if self.calibrating == Some(kind) {
            self.calibrating = None;
            self.events.push(RobotEvent::CalibrationEnd(kind));
        } else {
            bump(&mut self.stats.calibration_refused);
        }
    }

    fn result_taken(&mut self, taken: bool, event: RobotEvent) {
        if taken {
            self.events.push(event);
        } else {
            bump(&mut self.stats.acks_refused);
        }
    }

    /// Writes the most urgent frame that is due and says how long it is.
    fn fill(&mut self, buffer: &mut [u8; MAX_LEN], now: Instant) -> Option<usize> {
        if let Some(len) = self.fill_answer(buffer) {
            return Some(len);
        }
        if let Some(bias) = self.imu_result.take(now, self.config.result_period) {
            bump(&mut self.stats.results);
            return Some(write(bias, 0, buffer));
        }
        if let Some(bias) = self.mag_result.take(now, self.config.result_period) {
            bump(&mut self.stats.results);
            return Some(write(bias, 0, buffer));
        }
        let period = self.config.bias_request_period;
        if let Some(request) = period.and_then(|period| self.bias_request.take(now, period)) {
            bump(&mut self.stats.bias_requests);
            return Some(write(request, 0, buffer));
        }
        let missed = self.reports.take(now, self.config.report_period)?;
        self.stats.reports_skipped = self.stats.reports_skipped.saturating_add(missed);
        bump(&mut self.stats.reports);
        let index = self.index;
        self.index = index.wrapping_add(1);
        Some(match self.config.layout {
            ReportLayout::Firmware { version } => {
                write(FirmwareReport::new(&self.telemetry, version), index, buffer)
            }
            ReportLayout::Document => write(DocumentReport::new(&self.telemetry), index, buffer),
        })
    }

    fn fill_answer(&mut self, buffer: &mut [u8; MAX_LEN]) -> Option<usize> {
        let answers = &mut self.answers;
        if let Some(kind) = answers.calibration_start.take() {
            return Some(write(CalibrationStartAck::new(kind, ErrorCode::Fine), 0, buffer));
        }
        if let Some(kind) = answers.calibration_end.take() {
            return Some(write(CalibrationEndAck::new(kind, ErrorCode::Fine), 0, buffer));
        }
        if let Some(status) = answers.update.take() {
            return Some(write(OtaAck::new(status), 0, buffer));
        }
        if core::mem::take(&mut answers.pong) {
            bump(&mut self.stats.pongs);
            return Some(write(Pong::new(ErrorCode::Fine), 0, buffer));
        }
        answers.since = None;
        None
    }

    fn deadline(&self) -> Option<Instant> {
        [
            self.command_until,
            self.answers.since,
            self.imu_result.deadline(),
            self.mag_result.deadline(),
            self.bias_request.deadline(),
            self.reports.deadline(),
        ]
        .into_iter()
        .flatten()
        .min()
    }
}

/// The command within -100..=100, its lamp on or off as the vendor firmware reads it.
fn clamped(command: &MotorControl) -> MotorControl {
    let limit = MotorControl::LIMIT;
    MotorControl::new(command.speed().clamp(-limit, limit), command.angular().clamp(-limit, limit))
        .unwrap_or(MotorControl::STOP)
        .with_front_led(lamp_is_on(command))
}
