//! The async rover-link calls.

use crate::drive::{driver::Driver, error::DriveError};
use crate::{
    drive::{
        clock::Clock,
        driver::{ERROR_NAP, Needs},
        error::Operation,
    },
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl, Robot,
        host::{BiasStore, COAST, CalibrationStep, ReceivedReport},
        message::CalibrationKind,
    },
};

/// The async calls of a host: the same as the blocking ones, and cancel safe as the
/// [module](crate::drive) describes.
///
/// A command is sent even if its call is cancelled, and a cancelled stop is still due. A
/// calibration continues, and reports its end as an event.
impl<S: BiasStore, P, C> Driver<Host<S>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Waits for the robot to answer a ping, and returns the round trip. A ping is sent every
    /// [`HostConfig::ping_period`](crate::ucp::host::HostConfig::ping_period).
    ///
    /// # Errors
    ///
    /// [`DriveError::Timeout`] if nothing came within this time, and port errors.
    pub async fn ping_async(&mut self, within: Duration) -> Result<Duration, DriveError<P::Error>> {
        self.role.take_round_trip();
        let pong = self.until_async(self.now() + within, |driver| driver.pong()).await?;
        pong.ok_or(DriveError::Timeout(Operation::Ping))
    }

    /// Drives with speed and turn in percent (ruling U6); the lamp stays as it is. The command is
    /// sent now or, right after another command, within the next 20 ms, and repeated as long as the
    /// driver is called. Call it again within 500 ms (see [`Host::drive`]), or use
    /// [`drive_for_async`](Self::drive_for_async), which does.
    ///
    /// # Errors
    ///
    /// [`DriveError::Rover`], and port errors.
    pub async fn drive_async(
        &mut self,
        speed: i16,
        angular: i16,
    ) -> Result<(), DriveError<P::Error>> {
        self.command(speed, angular)?;
        self.service_async().await
    }

    /// Drives for `span`, then stops, and waits until the robot is seen to stand still, for at most
    /// [`COAST`](crate::ucp::host::COAST).
    ///
    /// If the future is dropped, the stop is due, and the next call sends it. **If there is no next
    /// call, only the robot's watchdog stops it**, and that of a vendor robot waits for silence on
    /// the line.
    ///
    /// # Errors
    ///
    /// The errors of [`stop_async`](Self::stop_async), then those of
    /// [`await_standstill_async`](Self::await_standstill_async), whatever else failed before;
    /// otherwise [`DriveError::Rover`] and port errors. A refused call changes nothing, and stops
    /// nothing.
    pub async fn drive_for_async(
        &mut self,
        speed: i16,
        angular: i16,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        self.command(speed, angular)?;
        let guard = StopOnDrop(self);
        let driven = guard.0.hold_command_async(speed, angular, span).await;
        drop(guard);
        self.send_stop_async().await?;
        self.await_standstill_async(COAST).await?;
        driven
    }

    /// Stops, and returns when the command has left the port: written and flushed (ruling U16).
    /// Continues through errors of the port for 100 ms. The stop is repeated as long as the driver
    /// is called; see [`Host::stop`]. A robot does not answer a stop: whether it obeys is in its
    /// reports, see [`await_standstill_async`](Self::await_standstill_async).
    ///
    /// After a failed flush, two whole copies are flushed before this returns `Ok`.
    ///
    /// # Errors
    ///
    /// Port errors, or [`DriveError::Timeout`]. **The robot may be driving.** The stop stays
    /// due, and the next call sends it.
    pub async fn stop_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop();
        self.send_stop_async().await
    }

    /// Waits until the robot, which was told to stop, is seen to stand still: three reports in a
    /// row, all received after the stop was flushed, show all four wheels at 2 rpm or less, and the
    /// last is an average of the time since ([`Host::stop_progress`]). So this takes at least
    /// [`HostConfig::rpm_average`](crate::ucp::host::HostConfig::rpm_average). Continues through
    /// errors of the port. For a rover that coasts, allow at least
    /// [`COAST`](crate::ucp::host::COAST).
    ///
    /// # Errors
    ///
    /// [`DriveError::NoStandstill`] after this time, and at once if the latest command is to move;
    /// [`DriveError::Timeout`] if the stop has not left by then; port errors, if the port still
    /// fails then. **The robot may be moving.** The stop is repeated as long as the driver
    /// is called.
    pub async fn await_standstill_async(
        &mut self,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let standing = self.until_through_errors_async(self.now() + within, Self::standing).await?;
        standing.unwrap_or_else(|| Err(self.no_standstill()))
    }

    /// Returns the latest report not returned yet; waits for one for this long, then returns
    /// `None`. Reports in between are skipped: to see every report, take events.
    ///
    /// # Errors
    ///
    /// Port errors.
    pub async fn next_report_async(
        &mut self,
        within: Duration,
    ) -> Result<Option<ReceivedReport>, DriveError<P::Error>> {
        self.until_async(self.now() + within, Self::report).await
    }

    /// Begins a calibration, and returns when the robot has agreed; see
    /// [`Host::start_calibration`]. For all attempts to fit, allow at least
    /// [`HostConfig::calibration_bound`](crate::ucp::host::HostConfig::calibration_bound).
    ///
    /// # Errors
    ///
    /// [`DriveError::Calibration`] or [`DriveError::Rover`], [`DriveError::Timeout`] after this
    /// time, and port errors.
    pub async fn start_calibration_async(
        &mut self,
        kind: CalibrationKind,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.begin_calibration(CalibrationStep::Start, kind)?;
        let outcome = self.until_async(deadline, Self::calibration).await?;
        outcome.ok_or(DriveError::Timeout(Operation::Calibration))?
    }

    /// Ends a calibration, and returns when the robot has agreed. The result comes later, as an
    /// event.
    ///
    /// # Errors
    ///
    /// Same as [`start_calibration_async`](Self::start_calibration_async).
    pub async fn end_calibration_async(
        &mut self,
        kind: CalibrationKind,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.begin_calibration(CalibrationStep::End, kind)?;
        let outcome = self.until_async(deadline, Self::calibration).await?;
        outcome.ok_or(DriveError::Timeout(Operation::Calibration))?
    }

    /// Keeps a command alive for `span`.
    async fn hold_command_async(
        &mut self,
        speed: i16,
        angular: i16,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let end = self.now() + span;
        let refused = |driver: &mut Self| {
            driver.drop_routine();
            driver.command(speed, angular).err()
        };
        while self.now() < end {
            let next = self.renew_at().min(end);
            let kept = self.until_with_async(next, Needs::WholePortInTime, refused).await?;
            if let Some(error) = kept {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Runs until the stop has left, through errors of the port.
    async fn send_stop_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let deadline = self.stop_deadline();
        let left = self.until_through_errors_async(deadline, Self::stopped).await?;
        left.ok_or(DriveError::Timeout(Operation::Stop))
    }

    /// Runs until `done` returns a value; `None` at `deadline`. A port that fails ends it only
    /// then.
    async fn until_through_errors_async<T>(
        &mut self,
        deadline: Instant,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            match self.until_with_async(deadline, Needs::HalfPort, &mut done).await {
                Err(error) if self.now() >= deadline => return Err(error),
                // If the port fails at once, pause before the next attempt.
                Err(_) => self.clock.delay_us(ERROR_NAP.as_micros()).await,
                found => return found,
            }
        }
    }
}

/// Makes a stop due when a call ends, however it ends.
struct StopOnDrop<'a, S: BiasStore, P, C: Clock>(&'a mut Driver<Host<S>, P, C>);

impl<S: BiasStore, P, C: Clock> Drop for StopOnDrop<'_, S, P, C> {
    fn drop(&mut self) {
        self.0.begin_stop();
    }
}

/// The async calls of a robot.
impl<P, C> Driver<Robot, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Returns the current command, once it has changed since the last call, including a standstill
    /// by the watchdog. Answers and reports meanwhile; waits for this
    /// long, then returns `None`.
    ///
    /// # Errors
    ///
    /// Port errors. The command stays in force until its watchdog ends it: see
    /// [`Robot::command`].
    pub async fn next_command_async(
        &mut self,
        within: Duration,
    ) -> Result<Option<MotorControl>, DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.until_with_async(deadline, Needs::HalfPort, Self::new_command).await
    }
}
