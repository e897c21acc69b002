//! The host's side: commands, pings, reports, calibrations.

mod calibration;
mod config;
mod event;
mod motor;
mod ping;
mod state;

pub use config::HostConfig;
pub use event::{
    CalibrationFailure, CalibrationStep, CommandError, FailureCause, HostEvent, HostStatistics,
    ReceivedReport, RoundTrip, UnknownFrame,
};

use super::{
    BiasStore, CalibrationKind, MAX_LEN, MotorControl, NetworkState, NoStore, SetNetworkState,
    role::{Inbox, halted, lamp_is_on, stands_still},
};
use crate::{endpoint::Endpoint, stream::Counters, time::Instant};
use state::{State, Update};

/// The host of a rover: a pure state machine, driven as [`Endpoint`] says.
///
/// * **Motor commands (U10).** The latest of [`drive`](Self::drive) and [`stop`](Self::stop) wins
///   and is repeated every 100 ms. When the application has called neither for 500 ms with the
///   robot on the move, speed and turn 0 are sent, and sent on, until the next call; the lamp stays.
///   No motor command goes out before the first call.
/// * **Link (U10).** Pings go out every 200 ms. The link goes up with the first valid frame that
///   comes from a robot, and down after 500 ms without one.
/// * **Reports (U9).** Every one is an event and the [latest](Self::last_report) is kept. Missing
///   ones are counted by their index. Counting starts anew after a lost link and when the robot asks
///   for its biases, as it does at boot and then once a second until it has them: reports lost around
///   such a request are not counted. A robot that restarts without either counts as up to 255.
/// * **Calibration (U11).** Requests are acknowledged, repeated or given up, within
///   [`HostConfig::calibration_bound`]. Results go to the [`BiasStore`] and are acknowledged once it
///   has them. The robot's request at boot is answered only if *both* results are stored: a made-up
///   zero is a wrong bias, would overwrite what the robot has found since, and would end its
///   asking. Who wants zeros puts them into the store.
/// * **Firmware update (U7, U13).** Starts by
///   [`start_firmware_update`](Self::start_firmware_update) and by nothing else.
///
/// What goes out first: motor commands, then answers, requests, the lamp's network state, pings.
/// Every frame takes the next `index`.
///
/// ```
/// use axlewire::{endpoint::Endpoint, time::Instant, ucp::{Host, HostConfig, MotorControl}};
///
/// let now = Instant::from_millis(0);
/// let mut host = Host::new(HostConfig::default(), now);
/// host.drive(MotorControl::turn_right(50, 10)?, now)?;
/// assert_eq!(host.poll_transmit(now).map(|frame| frame.len()), Some(24)); // the command
/// assert_eq!(host.poll_transmit(now).map(|frame| frame.len()), Some(8)); // a ping
/// assert_eq!(host.poll_transmit(now), None);
/// assert_eq!(host.poll_timeout(), Some(Instant::from_millis(100))); // the command again
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Host<S = NoStore> {
    inbox: Inbox,
    outgoing: [u8; MAX_LEN],
    state: State<S>,
}

/// What is known about the robot.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Link {
    /// Nothing has been heard yet, and the link timeout is not over.
    Waiting,
    /// Valid frames arrive.
    Up,
    /// None has for the link timeout.
    Down,
}

impl Host {
    /// A host that keeps no biases. The link timeout starts now.
    #[must_use]
    pub fn new(config: HostConfig, now: Instant) -> Self {
        Self::with_store(config, NoStore, now)
    }
}

impl<S: BiasStore> Host<S> {
    /// A host that keeps biases in `store`. The link timeout starts now.
    #[must_use]
    pub fn with_store(config: HostConfig, store: S, now: Instant) -> Self {
        let config = config.sane();
        Self {
            inbox: Inbox::new(config.baud, config.quiet_margin),
            outgoing: [0; MAX_LEN],
            state: State::new(config, store, now),
        }
    }

    /// Drives: sent at once, at the latest 20 ms after a command that differs, and repeated every
    /// 100 ms. To be called at least every 500 ms, be it with the same command: see
    /// [`HostEvent::DeadMan`].
    ///
    /// Only speed, turn and lamp are taken from `command`: all other fields are sent as 0 (U7).
    ///
    /// # Errors
    ///
    /// [`CommandError::StartsUpdate`] and [`CommandError::Value`] for what only a copy of a received
    /// command can be; [`CommandError::Updating`] during a firmware update.
    pub fn drive(&mut self, command: MotorControl, now: Instant) -> Result<(), CommandError> {
        if command.starts_update() {
            return Err(CommandError::StartsUpdate { version: command.version() });
        }
        if self.state.update != Update::None {
            return Err(CommandError::Updating);
        }
        let plain = MotorControl::new(command.speed(), command.angular())
            .map_err(CommandError::Value)?
            .with_front_led(lamp_is_on(&command));
        self.state.motor.command(plain, now, &self.state.config);
        Ok(())
    }

    /// Stands still: speed and turn 0 go out at once, the lamp stays.
    ///
    /// Always possible; it ends the silence of a firmware update.
    pub fn stop(&mut self, now: Instant) {
        self.state.update = Update::None;
        let command = self.state.motor.latest().as_ref().map_or(MotorControl::STOP, halted);
        self.state.motor.command(command, now, &self.state.config);
    }

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &HostConfig {
        &self.state.config
    }

    /// The motor command that is being repeated, the dead-man's if he has spoken.
    #[must_use]
    pub const fn command(&self) -> Option<MotorControl> {
        self.state.motor.latest()
    }

    /// Shows the state of the network on the robot's lamp: sent when it changes, when the link comes
    /// up and when the robot has booted (U8).
    ///
    /// # Errors
    ///
    /// [`CommandError::NetworkState`] for a state above 255.
    pub fn set_network_state(
        &mut self,
        network: NetworkState,
        now: Instant,
    ) -> Result<(), CommandError> {
        let body = SetNetworkState::new(network)
            .ok_or(CommandError::NetworkState { state: network.into() })?;
        if self.state.network.replace(body) != Some(body) {
            self.state.network_due = Some(now);
        }
        Ok(())
    }

    /// Asks the robot to begin a calibration.
    ///
    /// Comes to [`HostEvent::CalibrationStarted`] or [`HostEvent::CalibrationFailed`]. The robot does
    /// not move by itself: for the magnetometer the application turns it, for the IMU it keeps it
    /// still.
    ///
    /// # Errors
    ///
    /// [`CommandError::Calibrating`] while a request is unanswered, [`CommandError::CalibrationKind`]
    /// for a kind that no robot knows, [`CommandError::Updating`] during a firmware update.
    pub fn start_calibration(
        &mut self,
        kind: CalibrationKind,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.state.calibrate(CalibrationStep::Start, kind, now)
    }

    /// Asks the robot to end a calibration.
    ///
    /// Comes to [`HostEvent::CalibrationEnded`] or [`HostEvent::CalibrationFailed`], and later to
    /// [`HostEvent::ImuBias`] or [`HostEvent::MagBias`].
    ///
    /// # Errors
    ///
    /// As [`start_calibration`](Self::start_calibration).
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
    /// sent once, and behind it nothing: no command, no ping, until the robot refuses, or
    /// [`end_firmware_update`](Self::end_firmware_update) or [`stop`](Self::stop) is called. A
    /// shipped robot does not answer the request.
    ///
    /// # Errors
    ///
    /// [`CommandError::Moving`] unless the robot has been told to stand still,
    /// [`CommandError::Calibrating`] while a calibration request is unanswered,
    /// [`CommandError::Updating`] during a firmware update.
    pub fn start_firmware_update(
        &mut self,
        version: i16,
        now: Instant,
    ) -> Result<(), CommandError> {
        let state = &mut self.state;
        if state.update != Update::None {
            return Err(CommandError::Updating);
        }
        if state.calibration.is_some() {
            return Err(CommandError::Calibrating);
        }
        if state.motor.latest().is_some_and(|command| !stands_still(&command)) {
            return Err(CommandError::Moving);
        }
        state.update = Update::Asked { version, at: now };
        Ok(())
    }

    /// The firmware update is over: pings go out again, motor commands from the next call on.
    pub fn end_firmware_update(&mut self) {
        self.state.update = Update::None;
    }

    /// What is known about the robot.
    #[must_use]
    pub const fn link(&self) -> Link {
        self.state.link
    }

    /// The latest report, however old; also when its event was refused.
    #[must_use]
    pub const fn last_report(&self) -> Option<&ReceivedReport> {
        self.state.last_report.as_ref()
    }

    /// What the host has seen.
    #[must_use]
    pub const fn statistics(&self) -> &HostStatistics {
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

    /// The store of biases.
    pub const fn store(&mut self) -> &mut S {
        &mut self.state.store
    }
}

impl<S: BiasStore> Endpoint for Host<S> {
    type Event = HostEvent;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        let Self { inbox, state, .. } = self;
        inbox.take(bytes, now, |frame, at| state.receive(frame, at));
    }

    fn handle_timeout(&mut self, now: Instant) {
        let Self { inbox, state, .. } = self;
        inbox.settle(now, |frame, at| state.receive(frame, at));
        state.expire(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        // A command must not outlive its application because a driver is late.
        self.state.expire_command(now);
        let len = self.state.fill(&mut self.outgoing, now)?;
        self.state.index = self.state.index.wrapping_add(1);
        self.outgoing.get(..len)
    }

    fn poll_event(&mut self) -> Option<HostEvent> {
        self.state.events.pop()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        [self.inbox.deadline(), self.state.deadline()].into_iter().flatten().min()
    }
}
