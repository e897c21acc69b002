//! The robot: its commands, and the calls of its driver.

use super::{config::RobotConfig, event::RobotEvent, state::State, statistics::RobotStatistics};
use crate::{
    endpoint::{Endpoint, Unsent},
    stream::Counters,
    time::{Duration, Instant, earliest, reached, wire_time},
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

/// A rover, as its host sees it: a pure state machine, driven as [`Endpoint`] says.
///
/// * **Commands (U10).** A valid command holds for 500 ms, then speed and turn are 0 until the
///   next. Only a valid command counts: the vendor firmware is content with any byte, and drives on
///   through noise. Out of range is cut to -100..=100, as the vendor firmware does: a sender of 360
///   means full speed, and to refuse would leave the command before in force, which nobody wants
///   any more. A command that would start a firmware update (U7) is not taken and does not count.
/// * **Pings (U12).** Answered at once, and always with 0. The robot never says 1: a damaged frame
///   is refused before anyone knows that it was a ping. The host sees a lost ping.
/// * **Reports (U9, U10).** Every 20 ms from the first [`set_telemetry`](Self::set_telemetry) on,
///   one period after the one before; a robot that was held up skips what it missed. `index` counts
///   the reports that were sent. All other frames have index 0, as shipped robots send them.
/// * **Calibration (U11, U15).** A start or end is acknowledged at once, as soon as its event has
///   found room. A calibration lasts until the host ends it, its result has been acknowledged, or
///   [`abort_calibration`](Self::abort_calibration); a start that comes again meanwhile is told
///   with a flag. Results are sent every 1000 ms until acknowledged, and so is the request for
///   biases, from the first moment until it is answered.
/// * **Events (U15).** There is room for 16, and only what has found room ends an asking of either
///   side: without room a request is not acknowledged, and biases and acknowledgements are not
///   taken, so that the other side says them again. Changes of the command and of the network state
///   take at most half of the room; when that is short, the newest of them is replaced by the
///   latest, and both have getters.
/// * **Firmware update (U7).** Never starts by itself: it is an event, and the application decides.
/// * **Frames that only a robot sends (U13)** are counted and ignored. Shipped robots hang on id 5.
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
#[derive(Clone, Debug)]
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
            inbox: Inbox::new(config.baud, config.idle_margin, now),
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
        if reached(*command_until, now) { command.halted() } else { *command }
    }

    /// What to do from this moment on, if that has changed since the last call of this: standing still
    /// by the watchdog included. It cannot be lost in a full queue of events.
    pub fn take_command(&mut self, now: Instant) -> Option<MotorControl> {
        self.state.watch(now);
        let is_new = core::mem::take(&mut self.state.is_command_new);
        is_new.then_some(self.state.command)
    }

    /// What the next reports say. The first call starts them: nothing is reported unmeasured.
    pub fn set_telemetry(&mut self, telemetry: &Telemetry, now: Instant) {
        self.state.telemetry = *telemetry;
        self.state.reports.begin(now);
    }

    /// Sends the result of an IMU calibration until the host has it, in place of one still unsent.
    ///
    /// An acknowledgement does not say of which result: once this one has been sent, one still on
    /// its way for the result before counts for this one.
    pub fn calibration_result_imu(&mut self, bias: ImuBias, now: Instant) {
        self.state.begin_imu_result(bias, now);
    }

    /// Sends the result of a magnetometer calibration until the host has it, likewise.
    pub fn calibration_result_mag(&mut self, bias: MagBias, now: Instant) {
        self.state.begin_mag_result(bias, now);
    }

    /// Answers the host's request to update the firmware; `false` if none is unanswered.
    ///
    /// To update is up to the application: behind [`OtaStatus::Accepted`] it takes the port away
    /// from this role.
    pub fn answer_update(&mut self, status: OtaStatus, now: Instant) -> bool {
        self.state.answer_update(status, now)
    }

    /// What is being calibrated.
    #[must_use]
    pub fn calibrating(&self) -> Option<CalibrationKind> {
        self.state.calibrating()
    }

    /// Ends the calibration that is running, if any, without a result; says which it was.
    ///
    /// The host is not told: the protocol has no message for it. When it asks for the end, that is
    /// acknowledged and without effect, and no result follows.
    pub fn abort_calibration(&mut self) -> Option<CalibrationKind> {
        self.state.abort_calibration()
    }

    /// State of the host's network, as it was sent last; `None` before the first.
    #[must_use]
    pub const fn network_state(&self) -> Option<NetworkState> {
        self.state.network
    }

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &RobotConfig {
        &self.state.config
    }

    /// What the robot has seen.
    #[must_use]
    pub const fn statistics(&self) -> &RobotStatistics {
        &self.state.stats
    }

    /// Where every received byte went.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.inbox.counters()
    }

    /// Takes in the frames that `bytes` complete.
    fn receive(&mut self, mut bytes: &[u8], now: Instant) {
        while let Some((frame, at)) = self.inbox.next(&mut bytes) {
            self.state.receive(frame, at, now);
        }
    }

    /// Takes out the events that are not to stay.
    #[cfg(any(feature = "embedded-io", feature = "embedded-io-async"))]
    pub(crate) fn retain_events(&mut self, stays: impl FnMut(&RobotEvent) -> bool) {
        self.state.events.retain(stays);
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
        self.handle_old_input(bytes, now, now);
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

    fn frame_pause(&self) -> Duration {
        FRAME_PAUSE
    }

    fn wire_time(&self, bytes: usize) -> Duration {
        wire_time(bytes, self.state.config.baud)
    }

    /// 20 ms, of the 500 ms for which a command counts (U10).
    fn held_up_after(&self) -> Option<Duration> {
        Some(Duration::from_millis(20))
    }

    /// A command is as old as it can be (U10).
    fn handle_old_input(&mut self, bytes: &[u8], since: Instant, now: Instant) {
        if bytes.is_empty() {
            return;
        }
        self.inbox.receive(bytes, since, now);
        self.receive(bytes, now);
    }

    fn handle_unsent(&mut self, unsent: Unsent, now: Instant) {
        self.state.unsent(unsent, now);
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.state.events.pop()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        earliest(&[self.inbox.deadline(), self.state.deadline()])
    }
}
