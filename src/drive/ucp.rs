//! What a user of a rover link wants first.

use super::{Clock, DriveError, Driver, Step, Wish};
use crate::{
    time::{Duration, Instant},
    ucp::{
        BiasStore, CalibrationKind, CommandError, Host, HostEvent, MotorControl, ReceivedReport,
        Robot, RobotEvent,
    },
};

/// What the blocking and the async calls have in common.
impl<S: BiasStore, P, C: Clock> Driver<Host<S>, P, C> {
    fn begin_drive(&mut self, speed: i16, angular: i16) -> Result<(), CommandError> {
        let now = self.now();
        let lit = self.role.command().is_some_and(|command| command.front_led() != 0);
        let command = MotorControl::new(speed, angular).map_err(CommandError::Value)?;
        self.role.drive(command.with_front_led(lit), now)
    }

    fn begin_stop(&mut self) {
        let now = self.now();
        self.role.stop(now);
    }

    /// Forgets the pongs that came before.
    fn begin_ping(&mut self) {
        let _: Option<()> = self.sift(routine);
    }

    fn pong(&mut self) -> Option<Duration> {
        self.sift(|event| match event {
            HostEvent::Pong { round_trip, .. } => Step::Found(round_trip),
            event => routine(event),
        })
    }

    fn report(&mut self) -> Option<ReceivedReport> {
        self.sift(|event| match event {
            HostEvent::Report(report) => Step::Found(report),
            event => routine(event),
        })
    }

    fn begin_calibration(&mut self, kind: CalibrationKind) -> Result<(), CommandError> {
        let now = self.now();
        self.role.start_calibration(kind, now)
    }

    fn finish_calibration(&mut self, kind: CalibrationKind) -> Result<(), CommandError> {
        let now = self.now();
        self.role.end_calibration(kind, now)
    }

    fn calibration<E>(&mut self) -> Option<Result<(), DriveError<E>>> {
        self.sift(|event| match event {
            HostEvent::CalibrationStarted(_) | HostEvent::CalibrationEnded(_) => {
                Step::Found(Ok(()))
            }
            HostEvent::CalibrationFailed(failure) => {
                Step::Found(Err(DriveError::Calibration(failure)))
            }
            event => routine(event),
        })
    }
}

/// Reports and pongs are left out of what is kept: the host has the latest report, and counts both.
fn routine<T>(event: HostEvent) -> Step<T, HostEvent> {
    match event {
        HostEvent::Report(_) | HostEvent::Pong { .. } => Step::Drop,
        event => Step::Keep(event),
    }
}

impl<P, C: Clock> Driver<Robot, P, C> {
    fn command(&mut self) -> Option<MotorControl> {
        let found = self.sift(|event| match event {
            RobotEvent::Motor(command) => Step::Found(Some(command)),
            RobotEvent::WatchdogStop => Step::Found(None),
            event => Step::Keep(event),
        })?;
        Some(found.unwrap_or_else(|| self.role.command(self.latest)))
    }
}

/// The blocking calls of a host.
///
/// Reports and pongs that come in meanwhile are not kept as events, because
/// [`Host::last_report`] and [`Host::statistics`] have what counts; all other events are.
#[cfg(feature = "embedded-io")]
impl<S: BiasStore, P, C: Clock> Driver<Host<S>, P, C>
where
    P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
{
    /// Waits for the robot to answer a ping, of which one is sent every
    /// [`HostConfig::ping_period`](crate::ucp::HostConfig::ping_period); says how long that took.
    ///
    /// # Errors
    ///
    /// [`DriveError::Timeout`] at `deadline`, and those of the port.
    pub fn ping(&mut self, deadline: Instant) -> Result<Duration, DriveError<P::Error>> {
        self.begin_ping();
        self.until(deadline, Self::pong)?.ok_or(DriveError::Timeout(Wish::Ping))
    }

    /// Drives with speed and turn in percent (ruling U6), the lamp as it is. Sent now or, right after
    /// another command, within the next 20 ms, and repeated as long as the driver is called; it has
    /// to be called again within 500 ms, see [`Host::drive`].
    ///
    /// # Errors
    ///
    /// [`DriveError::Rover`], and those of the port.
    pub fn drive(&mut self, speed: i16, angular: i16) -> Result<(), DriveError<P::Error>> {
        self.begin_drive(speed, angular)?;
        self.service()
    }

    /// Stands still, and returns when the command is on the line; see [`Host::stop`].
    ///
    /// # Errors
    ///
    /// Those of the port: then nothing is known to have stopped.
    pub fn stop(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop();
        self.service()
    }

    /// The next report that has not been taken out, in order; waits for it until `deadline`, and is
    /// then `None`.
    ///
    /// # Errors
    ///
    /// Those of the port.
    pub fn next_report(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<ReceivedReport>, DriveError<P::Error>> {
        self.until(deadline, Self::report)
    }

    /// Begins a calibration, and returns when the robot has agreed; see [`Host::start_calibration`].
    /// A deadline after [`HostConfig::calibration_bound`](crate::ucp::HostConfig::calibration_bound)
    /// leaves room for all attempts.
    ///
    /// # Errors
    ///
    /// [`DriveError::Calibration`] or [`DriveError::Rover`], [`DriveError::Timeout`] at `deadline`,
    /// and those of the port.
    pub fn start_calibration(
        &mut self,
        kind: CalibrationKind,
        deadline: Instant,
    ) -> Result<(), DriveError<P::Error>> {
        self.begin_calibration(kind)?;
        self.until(deadline, Self::calibration)?.ok_or(DriveError::Timeout(Wish::Calibration))?
    }

    /// Ends a calibration, and returns when the robot has agreed. Its result comes later, as an
    /// event.
    ///
    /// # Errors
    ///
    /// As [`start_calibration`](Self::start_calibration).
    pub fn end_calibration(
        &mut self,
        kind: CalibrationKind,
        deadline: Instant,
    ) -> Result<(), DriveError<P::Error>> {
        self.finish_calibration(kind)?;
        self.until(deadline, Self::calibration)?.ok_or(DriveError::Timeout(Wish::Calibration))?
    }
}

/// The blocking calls of a robot.
#[cfg(feature = "embedded-io")]
impl<P, C: Clock> Driver<Robot, P, C>
where
    P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
{
    /// The next change of the command, standing still by the watchdog included; answers and reports
    /// meanwhile. `None` at `deadline`.
    ///
    /// # Errors
    ///
    /// Those of the port. The command holds on until its watchdog ends it: ask [`Robot::command`].
    pub fn next_command(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<MotorControl>, DriveError<P::Error>> {
        self.until(deadline, Self::command)
    }
}

/// The async calls of a host: the same, and as cancel safe as the [module](super) says. A cancelled
/// command has been taken and will be sent; a calibration goes on and tells its end as an event.
#[cfg(feature = "embedded-io-async")]
impl<S: BiasStore, P, C> Driver<Host<S>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Waits for the robot to answer a ping, of which one is sent every
    /// [`HostConfig::ping_period`](crate::ucp::HostConfig::ping_period); says how long that took.
    ///
    /// # Errors
    ///
    /// [`DriveError::Timeout`] at `deadline`, and those of the port.
    pub async fn ping_async(
        &mut self,
        deadline: Instant,
    ) -> Result<Duration, DriveError<P::Error>> {
        self.begin_ping();
        let pong = self.until_async(deadline, Self::pong).await?;
        pong.ok_or(DriveError::Timeout(Wish::Ping))
    }

    /// Drives with speed and turn in percent (ruling U6), the lamp as it is. Sent now or, right after
    /// another command, within the next 20 ms, and repeated as long as the driver is called; it has
    /// to be called again within 500 ms, see [`Host::drive`].
    ///
    /// # Errors
    ///
    /// [`DriveError::Rover`], and those of the port.
    pub async fn drive_async(
        &mut self,
        speed: i16,
        angular: i16,
    ) -> Result<(), DriveError<P::Error>> {
        self.begin_drive(speed, angular)?;
        self.service_async().await
    }

    /// Stands still, and returns when the command is on the line; see [`Host::stop`].
    ///
    /// # Errors
    ///
    /// Those of the port: then nothing is known to have stopped.
    pub async fn stop_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop();
        self.service_async().await
    }

    /// The next report that has not been taken out, in order; waits for it until `deadline`, and is
    /// then `None`.
    ///
    /// # Errors
    ///
    /// Those of the port.
    pub async fn next_report_async(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<ReceivedReport>, DriveError<P::Error>> {
        self.until_async(deadline, Self::report).await
    }

    /// Begins a calibration, and returns when the robot has agreed; see [`Host::start_calibration`].
    /// A deadline after [`HostConfig::calibration_bound`](crate::ucp::HostConfig::calibration_bound)
    /// leaves room for all attempts.
    ///
    /// # Errors
    ///
    /// [`DriveError::Calibration`] or [`DriveError::Rover`], [`DriveError::Timeout`] at `deadline`,
    /// and those of the port.
    pub async fn start_calibration_async(
        &mut self,
        kind: CalibrationKind,
        deadline: Instant,
    ) -> Result<(), DriveError<P::Error>> {
        self.begin_calibration(kind)?;
        let settled = self.until_async(deadline, Self::calibration).await?;
        settled.ok_or(DriveError::Timeout(Wish::Calibration))?
    }

    /// Ends a calibration, and returns when the robot has agreed. Its result comes later, as an
    /// event.
    ///
    /// # Errors
    ///
    /// As [`start_calibration_async`](Self::start_calibration_async).
    pub async fn end_calibration_async(
        &mut self,
        kind: CalibrationKind,
        deadline: Instant,
    ) -> Result<(), DriveError<P::Error>> {
        self.finish_calibration(kind)?;
        let settled = self.until_async(deadline, Self::calibration).await?;
        settled.ok_or(DriveError::Timeout(Wish::Calibration))?
    }
}

/// The async calls of a robot.
#[cfg(feature = "embedded-io-async")]
impl<P, C> Driver<Robot, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// The next change of the command, standing still by the watchdog included; answers and reports
    /// meanwhile. `None` at `deadline`.
    ///
    /// # Errors
    ///
    /// Those of the port. The command holds on until its watchdog ends it: ask [`Robot::command`].
    pub async fn next_command_async(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<MotorControl>, DriveError<P::Error>> {
        self.until_async(deadline, Self::command).await
    }
}
