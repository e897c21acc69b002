//! The steps of the rover-link calls, which wait for nothing.

#[cfg(feature = "embedded-io-async")]
use crate::drive::asynch;
use crate::drive::{
    clock::Clock,
    driver::Driver,
    error::{DriveError, Operation},
};
use crate::{
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl, Robot,
        host::{
            BiasStore, CalibrationStep, CommandError, HostConfig, HostEvent, ReceivedReport,
            StopProgress,
        },
        message::CalibrationKind,
        robot::{RobotConfig, RobotEvent},
    },
};

/// Time within which a stop must be flushed: the period of motor commands (ruling U16).
const STOP_BOUND: Duration = Duration::from_millis(100);

impl<P, C: Clock> Driver<Host, P, C> {
    /// A new [host](Host) with a port and a clock, which keeps no biases. To keep them, see
    /// [`with`](Driver::with) and [`Host::with_store`].
    ///
    /// ```
    /// use axlewire::{drive::{Clock, DriveError, Driver}, time::Duration, ucp::host::HostConfig};
    /// use embedded_io::{Read, ReadReady, Write};
    ///
    /// /// Drives ahead for two seconds.
    /// fn go<P, C>(port: P, clock: C) -> Result<(), DriveError<P::Error>>
    /// where
    ///     P: Read + ReadReady + Write,
    ///     C: Clock,
    /// {
    ///     let mut rover = Driver::host(HostConfig::direct(), port, clock);
    ///     rover.ping(Duration::from_secs(1))?;
    ///     rover.drive_for(30, 0, Duration::from_secs(2)) // percent ahead, percent of turn
    /// }
    /// ```
    pub fn host(config: HostConfig, port: P, clock: C) -> Self {
        Self::with(|now| Host::new(config, now), port, clock)
    }
}

impl<P, C: Clock> Driver<Robot, P, C> {
    /// A new [robot](Robot) with a port and a clock.
    ///
    /// ```
    /// use axlewire::drive::{Clock, Driver};
    /// use axlewire::{time::Duration, ucp::{MotorControl, Telemetry, robot::RobotConfig}};
    /// use embedded_io::{Read, ReadReady, Write};
    ///
    /// /// Never returns: a motor must stop when the port fails, too.
    /// fn run<P, C>(port: P, clock: C, set: fn(MotorControl), measure: fn() -> Telemetry) -> !
    /// where
    ///     P: Read + ReadReady + Write,
    ///     C: Clock,
    /// {
    ///     let mut robot = Driver::robot(RobotConfig::direct(), port, clock);
    ///     loop {
    ///         let _ = robot.next_command(Duration::from_millis(10)); // an error: show it
    ///         let now = robot.now();
    ///         set(robot.role().command(now)); // a standstill once the watchdog has fired
    ///         robot.role_mut().set_telemetry(&measure(), now);
    ///     }
    /// }
    /// ```
    pub fn robot(config: RobotConfig, port: P, clock: C) -> Self {
        Self::with(|now| Robot::new(config, now), port, clock)
    }
}

impl<S: BiasStore, P, C: Clock> Driver<Host<S>, P, C> {
    pub(super) fn command(&mut self, speed: i16, angular: i16) -> Result<(), CommandError> {
        let now = self.now();
        let is_lit = self.role.command().is_some_and(|command| command.front_led() != 0);
        let command = MotorControl::new(speed, angular).map_err(CommandError::Value)?;
        self.role.drive(command.with_front_led(is_lit), now)
    }

    /// When to renew a command that is to continue: long before the host's dead-man fires.
    pub(super) fn renew_at(&mut self) -> Instant {
        let half_us = self.role.config().dead_man.as_micros() / 2;
        self.now() + Duration::from_micros(half_us.max(1))
    }

    pub(super) fn begin_stop(&mut self) {
        let now = self.now();
        self.ends_at = None;
        self.role.stop(now);
    }

    pub(super) fn stop_deadline(&self) -> Instant {
        self.now() + STOP_BOUND
    }

    /// Whether the stop has left the port.
    pub(super) fn stopped(&mut self) -> Option<()> {
        self.drop_routine();
        (self.role.is_stop_sent() && self.is_sent()).then_some(())
    }

    /// `Ok` once the robot stands still; an error if it was not even told to.
    pub(super) fn standing<E>(&mut self) -> Option<Result<(), DriveError<E>>> {
        self.drop_routine();
        match self.role.stop_progress() {
            StopProgress::StandingStill => Some(Ok(())),
            StopProgress::NotAsked => Some(Err(DriveError::NoStandstill(StopProgress::NotAsked))),
            _ => None,
        }
    }

    /// Why the robot was not seen to stand still in time.
    pub(super) fn no_standstill<E>(&self) -> DriveError<E> {
        match self.role.stop_progress() {
            StopProgress::Due => DriveError::Timeout(Operation::Stop),
            progress => DriveError::NoStandstill(progress),
        }
    }

    /// Removes reports and pongs from the events: the host has the latest report and counts both.
    pub(super) fn drop_routine(&mut self) {
        self.role
            .retain_events(|event| !matches!(event, HostEvent::Report(_) | HostEvent::Pong { .. }));
    }

    /// The round trip of the next pong. Call it once before, to discard the current one.
    pub(super) fn pong(&mut self) -> Option<Duration> {
        self.drop_routine();
        self.role.take_round_trip()
    }

    pub(super) fn report(&mut self) -> Option<ReceivedReport> {
        self.drop_routine();
        self.role.take_report()
    }

    pub(super) fn begin_calibration(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
    ) -> Result<(), CommandError> {
        let now = self.now();
        if self.role.calibration_outcome().is_some() {
            // An outcome that came after its call had given up takes no room from the next.
            self.drop_calibration_events();
        }
        match step {
            CalibrationStep::Start => self.role.start_calibration(kind, now),
            CalibrationStep::End => self.role.end_calibration(kind, now),
        }
    }

    pub(super) fn drop_calibration_events(&mut self) {
        self.role.retain_events(|event| {
            !matches!(
                event,
                HostEvent::CalibrationStarted(_)
                    | HostEvent::CalibrationEnded(_)
                    | HostEvent::CalibrationFailed(_)
            )
        });
    }

    /// The outcome of the request. There is one request at a time, so it is that of this call.
    pub(super) fn calibration<E>(&mut self) -> Option<Result<(), DriveError<E>>> {
        self.drop_routine();
        let outcome = self.role.calibration_outcome()?;
        // The call returns the outcome, so it is not an event.
        self.drop_calibration_events();
        Some(outcome.map_err(DriveError::Calibration))
    }
}

impl<P, C: Clock> Driver<Robot, P, C> {
    pub(super) fn new_command(&mut self) -> Option<MotorControl> {
        let now = self.now();
        self.role
            .retain_events(|event| !matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog));
        self.role.take_command(now)
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P, C: Clock> asynch::Driver<Host, P, C> {
    /// A new [host](Host) with a port and a clock, as [`drive::Driver::host`].
    ///
    /// [`drive::Driver::host`]: Driver::host
    pub fn host(config: HostConfig, port: P, clock: C) -> Self {
        Driver::host(config, port, clock).into()
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P, C: Clock> asynch::Driver<Robot, P, C> {
    /// A new [robot](Robot) with a port and a clock, as [`drive::Driver::robot`].
    ///
    /// [`drive::Driver::robot`]: Driver::robot
    pub fn robot(config: RobotConfig, port: P, clock: C) -> Self {
        Driver::robot(config, port, clock).into()
    }
}
