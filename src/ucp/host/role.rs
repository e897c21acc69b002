//! The host: its commands, and the calls of its driver.

use super::{
    bias::{BiasStore, NoStore},
    config::HostConfig,
    event::{CalibrationFailure, CalibrationStep, CommandError, HostEvent, ReceivedReport},
    link::Link,
    standstill::StopProgress,
    state::State,
    statistics::HostStatistics,
};
use crate::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit},
    stream::Counters,
    time::{Duration, Instant, earliest},
    ucp::{
        codes::{CalibrationKind, NetworkState},
        header::MAX_LEN,
        inbox::Inbox,
        motor::MotorControl,
        role::FRAME_PAUSE,
    },
};

/// The host of a rover: a pure state machine, driven as described in [`Endpoint`].
///
/// ```
/// use axlewire::{endpoint::Endpoint, time::Instant, ucp::{host::HostConfig, Host, MotorControl}};
///
/// let now = Instant::from_millis(0);
/// let mut host = Host::new(HostConfig::default(), now);
/// assert_eq!(host.poll_transmit(now).map(|frame| frame.len()), Some(24)); // stand still
/// assert_eq!(host.poll_transmit(now).map(|frame| frame.len()), Some(8)); // a ping
/// assert_eq!(host.poll_transmit(now), None);
///
/// let now = Instant::from_millis(50);
/// host.drive(MotorControl::turn_right(50, 10)?, now)?;
/// assert_eq!(host.poll_transmit(now).map(|frame| frame.len()), Some(24)); // the command
/// assert_eq!(host.poll_timeout(), Some(Instant::from_millis(150))); // the command again
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// * **First frame (U16).** A zero motor command, before any ping or answer; it is sent first again
///   if it did not leave or its flush failed. If the application drives at once, its command
///   follows directly. The zero command is repeated every 100 ms until the first call, in case it
///   was damaged: a vendor robot keeps driving while any byte arrives, so a restarted host must
///   tell it to stand still. To disable this for hosts that only listen, clear
///   [`HostConfig::sends_first_stop`].
/// * **Motor commands (U10).** The latest of [`drive`](Self::drive) and [`stop`](Self::stop) wins
///   and is repeated every 100 ms. If the application calls neither for 500 ms while the robot is
///   moving, speed and turn 0 are sent and repeated until the next call; the lamp stays as it is.
/// * **Stops (U16).** Motor frames are never answered, so a stop is done when
///   [`is_stop_sent`](Self::is_stop_sent) returns `true` and the port has been flushed since.
///   [`handle_transmit`](Endpoint::handle_transmit) makes every motor command due again, twice
///   after a frame that was cut off or whose flush failed, because the robot may take the first for
///   the rest of that frame. Whether the robot obeys is in its reports:
///   [`stop_progress`](Self::stop_progress).
/// * **Link (U10).** Pings are sent every 200 ms. The link goes up with the first valid frame from
///   a robot, and down after 500 ms without one. While it is down, speed and turn 0 are sent, and
///   commands to move are refused.
/// * **Reports (U9).** Each report is an event, and the [latest](Self::last_report) is kept.
///   Missing reports are counted by their index. Counting restarts after a lost link and when the
///   robot asks for its biases, which it does at boot and then once a second until it has them:
///   reports lost around such a request are not counted. A robot that restarts without either adds
///   up to 255 to the count.
/// * **Calibration (U11, U15).** Requests are acknowledged, repeated or given up within
///   [`HostConfig::calibration_bound`]. Results go to the [`BiasStore`] and are acknowledged once
///   it has them. If the store does not [keep](BiasStore::keeps) them, they are only events, and
///   are acknowledged once the event has found room. Refusing a result withdraws an acknowledgement
///   that has not left: the robot would take it as acknowledging the refused one.
/// * **Biases (U11).** The robot's request at boot is answered only if *both* results are stored,
///   with those stored at the moment of sending: a made-up zero is a wrong bias, would overwrite
///   any result that the robot has found since, and would end its requests. To send zeros, store
///   zeros.
/// * **Firmware update (U7, U13).** Only [`start_firmware_update`](Self::start_firmware_update)
///   starts one, and only while the reports show a standstill behind a stop.
/// * **Builds that hang (U14)** on ids 5..=0x0A: set [`HostConfig::low_ids_only`] to send none of
///   these.
/// * **Events (U15).** The queue holds 16 events. Reports, pongs and other recurring events take at
///   most half of it, so that they never displace rare ones.
///
/// Frames are sent in this order: motor commands, answers, requests, the network state for the
/// lamp, pings. Every frame takes the next `index`.
#[derive(Clone, Debug)]
pub struct Host<S = NoStore> {
    inbox: Inbox,
    outgoing: [u8; MAX_LEN],
    state: State<S>,
}

impl Host {
    /// Creates a host that keeps no biases. The link timeout starts now.
    #[must_use]
    pub fn new(config: HostConfig, now: Instant) -> Self {
        Self::with_store(config, NoStore, now)
    }
}

impl<S: BiasStore> Host<S> {
    /// Creates a host that keeps biases in `store`. The link timeout starts now.
    #[must_use]
    pub fn with_store(config: HostConfig, store: S, now: Instant) -> Self {
        let config = config.sane();
        Self {
            inbox: Inbox::new(config.baud, config.idle_margin, now),
            outgoing: [0; MAX_LEN],
            state: State::new(config, store, now),
        }
    }

    /// Drives the robot. A new command is sent at once, but no sooner than 20 ms after a different
    /// one, and is repeated every 100 ms. The same command again only feeds the dead-man: call this
    /// at least every 500 ms, see [`HostEvent::DeadMan`].
    ///
    /// To pass on a received command, convert it with [`MotorControl::try_from`] (U7).
    ///
    /// # Errors
    ///
    /// [`CommandError::Updating`] during a firmware update, and [`CommandError::LinkDown`] for a
    /// command to move while the robot is not heard.
    pub fn drive(&mut self, command: MotorControl, now: Instant) -> Result<(), CommandError> {
        if !self.state.update.is_none() {
            return Err(CommandError::Updating);
        }
        if !command.stands_still() && self.state.link == Link::Down {
            return Err(CommandError::LinkDown);
        }
        self.state.motor.command(command, now, &self.state.config);
        Ok(())
    }

    /// Stops the robot: speed and turn 0 are sent at once, or 20 ms behind the last stop, and the
    /// lamp stays as it is.
    ///
    /// Always accepted; it ends the silence of a firmware update. Asked for again before the robot
    /// was seen to obey, it is sent again, and reports since the first stop count. The stop is done
    /// when [`is_stop_sent`](Self::is_stop_sent) returns `true` and the port has been flushed since
    /// (U16).
    pub fn stop(&mut self, now: Instant) {
        self.end_firmware_update(now);
        self.state.motor.stop(now, &self.state.config);
    }

    /// Whether the robot has been told to stand still, and nothing else since (ruling U16).
    ///
    /// `true` if the latest command is to stand still and has been handed out, twice where that is
    /// needed, and [`handle_transmit`](Endpoint::handle_transmit) has not taken it back. Once the
    /// port has then been flushed, the stop is done; motor frames are never answered.
    #[must_use]
    pub fn is_stop_sent(&self) -> bool {
        self.state.motor.is_stop_sent()
    }

    /// Whether the robot was seen to obey the latest stop, given by [`stop`](Self::stop), by a
    /// command to stand still, by the dead-man, by a link that went down or as the first frame
    /// (ruling U16).
    ///
    /// [`StopProgress::StandingStill`] takes three reports in a row that show all four wheels at
    /// 2 rpm or less. Both report layouts have wheel speeds, so both count. A report counts if it
    /// was complete at least its time on the line after the stop had been flushed: that is when
    /// [`Transmit::Flushed`] was told, or, by a driver that never tells it, when the next round
    /// began. And the last must have begun to arrive 1.1 s after that
    /// ([`HostConfig::rpm_average`]): a vendor robot reports averages, in which wheels that began
    /// to turn a moment ago still stand still. A wheel that moves again, or 500 ms without a report
    /// ([`HostConfig::link_timeout`]), ends it, with the next call of the driver, and so does a
    /// port that cannot be read to its end. It is as of the last look at the port: a report may
    /// have arrived while frames were flushed since.
    #[must_use]
    pub fn stop_progress(&self) -> StopProgress {
        self.state.motor.stop_progress()
    }

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &HostConfig {
        &self.state.config
    }

    /// The command in force: the latest, or the stop once the dead-man has fired; `None` before the
    /// first.
    #[must_use]
    pub const fn command(&self) -> Option<MotorControl> {
        self.state.motor.latest()
    }

    /// Shows the state of the network on the robot's lamp. It is sent when it changes, when the
    /// link comes up, and when the robot has booted (U8).
    ///
    /// # Errors
    ///
    /// [`CommandError::Value`] for a state above 255, [`CommandError::LowIdsOnly`] with
    /// [`HostConfig::low_ids_only`].
    pub fn set_network_state(
        &mut self,
        network: NetworkState,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.state.show(network, now)
    }

    /// Asks the robot to start a calibration.
    ///
    /// Ends with [`HostEvent::CalibrationStarted`] or [`HostEvent::CalibrationFailed`]. The robot
    /// does not move by itself: the application turns it for the magnetometer, and keeps it still
    /// for the IMU.
    ///
    /// # Errors
    ///
    /// [`CommandError::Calibrating`] while a request is unanswered,
    /// [`CommandError::CalibrationKind`] for a kind that no robot knows, [`CommandError::Updating`]
    /// during a firmware update.
    pub fn start_calibration(
        &mut self,
        kind: CalibrationKind,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.state.calibrate(CalibrationStep::Start, kind, now)
    }

    /// Asks the robot to end a calibration.
    ///
    /// Ends with [`HostEvent::CalibrationEnded`] or [`HostEvent::CalibrationFailed`];
    /// [`HostEvent::ImuBias`] or [`HostEvent::MagBias`] follows later.
    ///
    /// # Errors
    ///
    /// Same as [`start_calibration`](Self::start_calibration).
    pub fn end_calibration(
        &mut self,
        kind: CalibrationKind,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.state.calibrate(CalibrationStep::End, kind, now)
    }

    /// **Starts a firmware update** in a robot whose firmware is older than `version`.
    ///
    /// The robot then leaves this protocol and waits for YMODEM on the same line. So the request is
    /// sent once, and nothing after it, not even a ping, until
    /// [`end_firmware_update`](Self::end_firmware_update) or [`stop`](Self::stop) is called,
    /// whatever the robot answers: call one of them after a refusal. A shipped robot does not
    /// answer the request.
    ///
    /// During an update the robot hears no stop either, so the call is refused unless
    /// [`stop_progress`](Self::stop_progress) is [`StopProgress::StandingStill`]: **call `stop` and
    /// `await_standstill` of the driver before**. Two more stops precede the request. If the robot
    /// is not seen to stand still any more behind them, or the port does not take the request
    /// within 20 ms, the update is given up: [`HostEvent::UpdateNotSent`]. After a failed flush the
    /// request may have arrived, and the host stays silent.
    ///
    /// A robot that sends no reports cannot be seen to stand still. To update it, make sure of that
    /// yourself, take the port with `Driver::into_parts`, and write
    /// [`OtaRequest`](crate::ucp::message::OtaRequest) to it.
    ///
    /// # Errors
    ///
    /// [`CommandError::LinkDown`] if the robot is not heard, [`CommandError::Moving`] if it is not
    /// seen to stand still, [`CommandError::Calibrating`] while a calibration request is
    /// unanswered, [`CommandError::Updating`] during a firmware update,
    /// [`CommandError::LowIdsOnly`] with [`HostConfig::low_ids_only`].
    pub fn start_firmware_update(
        &mut self,
        version: i16,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.state.start_update(version, now)
    }

    /// Ends a firmware update: pings and the zero motor command are sent again.
    pub fn end_firmware_update(&mut self, now: Instant) {
        self.state.end_update(now);
    }

    /// Whether a firmware update was asked for and has not ended: no command to move is accepted,
    /// and once the request has been sent, the line is silent.
    #[must_use]
    pub fn is_updating(&self) -> bool {
        !self.state.update.is_none()
    }

    /// State of the link to the robot.
    #[must_use]
    pub const fn link(&self) -> Link {
        self.state.link
    }

    /// The latest report, however old, even if its event was lost.
    #[must_use]
    pub const fn last_report(&self) -> Option<&ReceivedReport> {
        self.state.last_report.as_ref()
    }

    /// The latest report, unless this method has already returned it.
    pub fn take_report(&mut self) -> Option<ReceivedReport> {
        let is_new = core::mem::take(&mut self.state.is_report_new);
        self.state.last_report.filter(|_| is_new)
    }

    /// The round trip of the latest pong, unless this method has already returned it.
    pub const fn take_round_trip(&mut self) -> Option<Duration> {
        self.state.new_round_trip.take()
    }

    /// Outcome of the latest calibration request; `None` before the first and while one is
    /// unanswered.
    #[must_use]
    pub const fn calibration_outcome(&self) -> Option<Result<(), CalibrationFailure>> {
        self.state.settled
    }

    /// Counts of the host.
    #[must_use]
    pub const fn statistics(&self) -> &HostStatistics {
        &self.state.stats
    }

    /// Accounts for every received byte.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.inbox.counters()
    }

    /// Number of events lost because the application did not poll in time; saturates at 2^32 - 1.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.state.events.lost()
    }

    /// Removes the events that `stays` rejects, including a calibration's that waits for room.
    pub(crate) fn retain_events(&mut self, stays: impl FnMut(&HostEvent) -> bool) {
        self.state.retain_events(stays);
    }

    /// Processes the frames that `bytes` complete.
    fn receive(&mut self, mut bytes: &[u8]) {
        while let Some((frame, at, early)) = self.inbox.next(&mut bytes) {
            self.state.arrived_since = Some(early);
            self.state.receive(frame, at);
        }
    }

    /// The store of biases.
    #[must_use]
    pub const fn store(&self) -> &S {
        &self.state.store
    }

    /// The store of biases, for changing its contents.
    pub const fn store_mut(&mut self) -> &mut S {
        &mut self.state.store
    }
}

impl<S: BiasStore> Endpoint for Host<S> {
    type Event = HostEvent;

    /// Reports among the bytes count as received at the earliest possible time where it matters
    /// whether a stop was before them (U16), and otherwise now.
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let now = arrived.now();
        if bytes.is_empty() {
            if matches!(arrived, Arrival::Between { .. }) {
                self.state.motor.standstill().doubt();
            }
            return self.state.expire_dead_man(now);
        }
        self.inbox.receive(bytes, now, arrived.since(), now);
        self.receive(bytes);
        self.state.arrived_since = None;
    }

    fn handle_timeout(&mut self, now: Instant) {
        while self.inbox.settle(now) {
            self.receive(&[]);
        }
        self.state.expire(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        // A command must not outlive its application because the driver is late.
        self.state.expire_command(now);
        let len = self.state.fill(&mut self.outgoing, now)?;
        self.outgoing.get(..len)
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        match outcome.into() {
            Transmit::Taken => self.state.taken(),
            Transmit::Flushed => self.state.flushed(now),
            Transmit::Unsent(unsent) => self.state.unsent(unsent, now),
        }
    }

    /// Whether it is a motor command that moves the robot and is no longer the latest.
    fn is_outdated(&self) -> bool {
        self.state.has_sent_old_command()
    }

    /// All bytes count from when the port was last seen empty: a report may have waited while a
    /// stop was flushed, or while the application was away.
    fn line_rules(&self) -> LineRules {
        LineRules {
            frame_pause: FRAME_PAUSE,
            baud: self.state.config.baud,
            held_up_after: Some(Duration::ZERO),
        }
    }

    fn poll_event(&mut self) -> Option<HostEvent> {
        self.state.pop_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        earliest(&[self.inbox.deadline(), self.state.deadline()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ucp::{
        Body,
        message::{CalibrationStartAck, ErrorCode, MagBias},
    };

    #[test]
    fn an_outcome_that_waits_for_room_can_be_taken_out_like_one_in_the_queue() {
        let now = Instant::from_millis(0);
        let kind = CalibrationKind::Imu;
        let ack = CalibrationStartAck::new(kind, ErrorCode::Fine).frame(0);
        let mut host = Host::new(HostConfig::default(), now);
        for value in 0..20 {
            host.handle_input(MagBias::new([value; 3]).frame(0).as_bytes(), now);
        }
        for _ in 0..3 {
            assert_eq!(host.start_calibration(kind, now), Ok(()));
            while host.poll_transmit(now).is_some() {}
            host.handle_input(ack.as_bytes(), now);
            assert_eq!(host.calibration_outcome(), Some(Ok(())));
            assert_eq!(host.start_calibration(kind, now), Err(CommandError::Calibrating));
            // An event that stays is reported as before.
            host.retain_events(|_| true);
            assert_eq!(host.start_calibration(kind, now), Err(CommandError::Calibrating));
            host.retain_events(|event| !matches!(event, HostEvent::CalibrationStarted(_)));
        }
        let events = core::iter::from_fn(|| host.poll_event());
        assert_eq!(events.filter(|event| matches!(event, HostEvent::MagBias(_))).count(), 15);
    }
}
