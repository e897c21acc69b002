//! The robot: its commands, and the calls of its driver.

use super::{config::RobotConfig, event::RobotEvent, state::State, statistics::RobotStatistics};
use crate::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit},
    stream::Counters,
    time::{Duration, Instant, earliest, reached},
    ucp::{
        body::{ImuBias, MagBias},
        codes::{CalibrationKind, NetworkState, OtaStatus},
        header::MAX_LEN,
        inbox::Inbox,
        motor::MotorControl,
        report::Telemetry,
        role::FRAME_PAUSE,
    },
};

/// A rover as seen by its host: a pure state machine, driven as described in [`Endpoint`].
///
/// ```
/// use axlewire::{endpoint::Endpoint, time::Instant};
/// use axlewire::ucp::{robot::RobotConfig, Body, MotorControl, Robot};
///
/// let mut robot = Robot::new(RobotConfig::default(), Instant::from_millis(0));
/// let received = MotorControl::new(60, 0)?.frame(0);
/// robot.handle_input(received.as_bytes(), Instant::from_millis(10));
/// assert_eq!(robot.command(Instant::from_millis(509)).speed(), 60);
/// assert_eq!(robot.command(Instant::from_millis(510)).speed(), 0);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
///
/// * **Commands (U10).** A valid command holds for 500 ms; then speed and turn are 0 until the
///   next. Only valid commands count: the vendor firmware accepts any byte, and drives on through
///   noise. Values out of range are clamped to -100..=100, as in the vendor firmware: a sender of
///   360 means full speed, and refusing it would leave an outdated command in force. A command that
///   would start a firmware update (U7) is refused and does not count.
/// * **Pings (U12).** Answered at once, and always with 0. The robot never sends 1: a damaged frame
///   is rejected before it is known to be a ping. The host notices a lost ping.
/// * **Reports (U9, U10).** Sent every 20 ms from the first [`set_telemetry`](Self::set_telemetry)
///   on, each one period after the previous one; a robot that was held up skips the reports it
///   missed. `index` counts the reports sent. All other frames have index 0, as from shipped
///   robots.
/// * **Calibration (U11, U15).** A start or end is acknowledged as soon as its event has found
///   room. A calibration lasts until the host ends it, its result has been acknowledged, or
///   [`abort_calibration`](Self::abort_calibration) is called; a start repeated meanwhile is
///   reported with a flag. Results are sent every 1000 ms until acknowledged, and so is the request
///   for biases, from the start until it is answered.
/// * **Events (U15).** The queue holds 16 events, and only an event that has found room settles a
///   request from either side: without room a request is not acknowledged, and biases and
///   acknowledgements are not accepted, so that the other side repeats them. Changes of the command
///   and of the network state take at most half of the queue, or one more place each; without room,
///   the latest replaces the newest of its kind, and both have getters.
/// * **Firmware update (U7).** Never starts by itself: it is an event, and the application decides.
/// * **Frames that only a robot sends (U13)** are counted and ignored. Shipped robots hang on id 5.
#[derive(Clone, Debug)]
pub struct Robot {
    inbox: Inbox,
    outgoing: [u8; MAX_LEN],
    state: State,
}

impl Robot {
    /// Creates a robot that has just booted: it stands still and asks for its biases.
    #[must_use]
    pub fn new(config: RobotConfig, now: Instant) -> Self {
        let config = config.sane();
        Self {
            inbox: Inbox::new(config.baud, config.idle_margin, now),
            outgoing: [0; MAX_LEN],
            state: State::new(config, now),
        }
    }

    /// The command in force: the latest, or a stop if it is too old.
    ///
    /// Correct at any time, whether or not events have been taken out and timeouts handled.
    #[must_use]
    pub fn command(&self, now: Instant) -> MotorControl {
        let State { command, command_until, .. } = &self.state;
        if reached(*command_until, now) { command.halted() } else { *command }
    }

    /// The command in force, if it has changed since the last call of this method; a stop by the
    /// watchdog is a change. It cannot be lost in a full event queue.
    pub fn take_command(&mut self, now: Instant) -> Option<MotorControl> {
        self.state.watch(now);
        let is_new = core::mem::take(&mut self.state.is_command_new);
        is_new.then_some(self.state.command)
    }

    /// Sets the content of the next reports. The first call starts them: nothing unmeasured is
    /// reported.
    pub fn set_telemetry(&mut self, telemetry: &Telemetry, now: Instant) {
        self.state.telemetry = *telemetry;
        self.state.reports.begin(now);
    }

    /// Sends the result of an IMU calibration until the host has it, replacing one not yet
    /// acknowledged.
    ///
    /// An acknowledgement does not identify its result: once this result has been sent, a late
    /// acknowledgement of the previous one counts for this one.
    pub fn calibration_result_imu(&mut self, bias: ImuBias, now: Instant) {
        self.state.begin_imu_result(bias, now);
    }

    /// Same as [`calibration_result_imu`](Self::calibration_result_imu), for a magnetometer
    /// calibration.
    pub fn calibration_result_mag(&mut self, bias: MagBias, now: Instant) {
        self.state.begin_mag_result(bias, now);
    }

    /// Answers the host's firmware update request; returns `false` if there is no unanswered one.
    ///
    /// The application performs the update: **it stops the motors first**, because the command
    /// stays in force for its 500 ms. After [`OtaStatus::Accepted`] it takes the port away from
    /// this role.
    pub fn answer_update(&mut self, status: OtaStatus, now: Instant) -> bool {
        self.state.answer_update(status, now)
    }

    /// The calibration that is running, if any.
    #[must_use]
    pub fn calibrating(&self) -> Option<CalibrationKind> {
        self.state.calibrating()
    }

    /// Ends the running calibration, if any, without a result; returns which one it was.
    ///
    /// The host is not told: the protocol has no message for it. If the host asks for the end, the
    /// request is acknowledged without effect, and no result follows.
    pub fn abort_calibration(&mut self) -> Option<CalibrationKind> {
        self.state.abort_calibration()
    }

    /// The state of the host's network as last received; `None` before the first.
    #[must_use]
    pub const fn network_state(&self) -> Option<NetworkState> {
        self.state.network
    }

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &RobotConfig {
        &self.state.config
    }

    /// Counts of the robot.
    #[must_use]
    pub const fn statistics(&self) -> &RobotStatistics {
        &self.state.stats
    }

    /// Accounts for every received byte.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.inbox.counters()
    }

    /// Processes the frames that `bytes` complete.
    fn receive(&mut self, mut bytes: &[u8], now: Instant) {
        while let Some((frame, at, _)) = self.inbox.next(&mut bytes) {
            self.state.receive(frame, at, now);
        }
    }

    /// Removes the events that `stays` rejects.
    pub(crate) fn retain_events(&mut self, stays: impl FnMut(&RobotEvent) -> bool) {
        self.state.events.retain(stays);
    }

    /// Number of events lost because the application did not poll in time; saturates at 2^32 - 1.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.state.events.lost()
    }
}

impl Endpoint for Robot {
    type Event = RobotEvent;

    /// Treats commands as old as they can be (U10).
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let (since, now) = (arrived.since(), arrived.now());
        if bytes.is_empty() {
            return self.state.watch(now);
        }
        self.inbox.receive(bytes, since, since, now);
        self.receive(bytes, now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        while self.inbox.settle(now) {
            self.receive(&[], now);
        }
        self.state.watch(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let len = self.state.fill(&mut self.outgoing, now)?;
        self.outgoing.get(..len)
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        match outcome.into() {
            Transmit::Taken => self.state.taken(),
            Transmit::Flushed => self.state.flushed(),
            Transmit::Unsent(unsent) => self.state.unsent(unsent, now),
        }
    }

    /// Old are bytes that may have waited for 20 ms of the 500 ms for which a command is valid
    /// (U10).
    fn line_rules(&self) -> LineRules {
        LineRules {
            frame_pause: FRAME_PAUSE,
            baud: self.state.config.baud,
            held_up_after: Some(Duration::from_millis(20)),
        }
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.state.events.pop()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        earliest(&[self.inbox.deadline(), self.state.deadline()])
    }
}
