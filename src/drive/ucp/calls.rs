//! The rover-link calls, written once for both worlds.

use crate::{
    drive::{
        clock::Clock,
        driver::{Driver, Needs},
        error::{DriveError, Operation},
        worlds::AtEnd,
    },
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl, Robot,
        host::{BiasStore, COAST, CalibrationStep, ReceivedReport},
        message::CalibrationKind,
    },
};

macro_rules! calls {
    ($Driver:ident, [$($Port:tt)+], [$($Clock:tt)+], [$($async:tt)?], [$($await:tt)*]) => {
/// The calls of a host.
///
/// Reports and pongs received meanwhile are not kept as events, because [`Host::last_report`] and
/// [`Host::statistics`] have their contents; all other events are kept.
impl<S: BiasStore, P: $($Port)+, C: $($Clock)+> $Driver<Host<S>, P, C> {
    /// Waits for the robot to answer a ping, and returns the round trip. A ping is sent every
    /// [`HostConfig::ping_period`](crate::ucp::host::HostConfig::ping_period).
    ///
    /// # Errors
    ///
    /// [`DriveError::Timeout`] if nothing came within this time, and port errors.
    pub $($async)? fn ping(&mut self, within: Duration) -> Result<Duration, DriveError<P::Error>> {
        self.role.take_round_trip();
        let pong = self.until(self.now() + within, |driver| driver.pong())$($await)*?;
        pong.ok_or(DriveError::Timeout(Operation::Ping))
    }

    /// Drives with speed and turn in percent; the lamp stays as it is. A positive turn is a steering
    /// wheel turned to the right: ahead and in reverse, see [`MotorControl::yaw_right`]
    /// (ruling U6). A new command is
    /// sent now or, right after another one, within the next 20 ms, and repeated every 100 ms as
    /// long as the driver is called. The same command again is not sent more often, and only feeds
    /// the dead-man: call it as often as you like, and at least every 500 ms (see [`Host::drive`]),
    /// or use [`drive_for`](Self::drive_for), which does.
    ///
    /// # Errors
    ///
    /// [`DriveError::Value`] for more than 100 percent, [`DriveError::Rover`], and port errors.
    /// **After a port error the command stays in force**
    /// until 500 ms after this call, and is sent when the port works again: call
    /// [`stop`](Self::stop).
    pub $($async)? fn drive(
        &mut self,
        speed: i16,
        angular: i16,
    ) -> Result<(), DriveError<P::Error>> {
        self.command(speed, angular)?;
        self.service()$($await)*
    }

    /// Drives for `span`, then stops, and waits until the robot is seen to stand still, for at most
    /// [`COAST`](crate::ucp::host::COAST). A span below
    /// [`command_gap`](crate::ucp::host::HostConfig::command_gap) may be over before the command
    /// has left.
    ///
    /// # Errors
    ///
    /// The errors of [`stop`](Self::stop), then those of
    /// [`await_standstill`](Self::await_standstill), whatever else failed before; otherwise
    /// those of [`drive`](Self::drive). A refused call changes nothing, and stops nothing.
    pub $($async)? fn drive_for(
        &mut self,
        speed: i16,
        angular: i16,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        self.command(speed, angular)?;
        let guard = AtEnd { driver: self, then: |driver| driver.begin_stop() };
        let driven = guard.driver.hold_command(speed, angular, span)$($await)*;
        drop(guard);
        self.send_stop()$($await)*?;
        self.await_standstill(COAST)$($await)*?;
        driven
    }

    /// Stops, and returns when the command has left the port: written and flushed (ruling U16).
    /// Continues through errors of the port for 100 ms; an async port that stalls is waited for a
    /// second longer for each write and flush. The stop is repeated as long as the driver
    /// is called; see [`Host::stop`]. A robot does not answer a stop: whether it obeys is in its
    /// reports, see [`await_standstill`](Self::await_standstill).
    ///
    /// After a failed flush, two whole copies are flushed before this returns `Ok`.
    ///
    /// # Errors
    ///
    /// Port errors, or [`DriveError::Timeout`]. **The robot may be driving.** The stop stays
    /// due, and the next call sends it.
    pub $($async)? fn stop(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop();
        self.send_stop()$($await)*
    }

    /// Waits until the robot, which was told to stop, is seen to stand still: three reports in a
    /// row, all received after the stop was flushed, show all four wheels at 2 rpm or less, and the
    /// last is an average of the time since ([`Host::stop_progress`]). So this takes at least
    /// [`HostConfig::rpm_average`](crate::ucp::host::HostConfig::rpm_average); a stop that is asked
    /// for again meanwhile joins the first. Continues through errors of the port. For a rover that
    /// coasts, allow at least [`COAST`](crate::ucp::host::COAST). If another program drives the
    /// robot meanwhile, its latest moves are not in the average yet.
    ///
    /// # Errors
    ///
    /// [`DriveError::NoStandstill`] after this time, and at once if the latest command is to move;
    /// [`DriveError::Timeout`] if the stop has not left by then; port errors, if the port still
    /// fails then. **The robot may be moving.** The stop is repeated as long as the driver
    /// is called.
    pub $($async)? fn await_standstill(
        &mut self,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + within;
        loop {
            let standing = self.until_through_errors(deadline, Driver::standing)$($await)*?;
            let Some(Ok(())) = standing else {
                return standing.unwrap_or_else(|| Err(self.no_standstill()));
            };
            // Reports may have arrived while the round was sending.
            let looked = self.receive()$($await)*;
            self.expire();
            if let Some(standing) = self.standing() {
                return standing;
            }
            if self.now() >= deadline {
                return looked.and_then(|()| Err(self.no_standstill()));
            }
        }
    }

    /// Returns the latest report not returned yet; waits for one for this long, then returns
    /// `None`. Reports in between are skipped: to see every report, take events.
    ///
    /// # Errors
    ///
    /// Port errors.
    pub $($async)? fn next_report(
        &mut self,
        within: Duration,
    ) -> Result<Option<ReceivedReport>, DriveError<P::Error>> {
        self.until(self.now() + within, Driver::report)$($await)*
    }

    /// Begins a calibration, and returns when the robot has agreed; see
    /// [`Host::start_calibration`]. For all attempts to fit, allow at least
    /// [`HostConfig::calibration_bound`](crate::ucp::host::HostConfig::calibration_bound).
    ///
    /// # Errors
    ///
    /// [`DriveError::Calibration`] or [`DriveError::Rover`], [`DriveError::Timeout`] after this
    /// time, and port errors.
    pub $($async)? fn start_calibration(
        &mut self,
        kind: CalibrationKind,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.begin_calibration(CalibrationStep::Start, kind)?;
        let outcome = self.until(deadline, Driver::calibration)$($await)*?;
        outcome.ok_or(DriveError::Timeout(Operation::Calibration))?
    }

    /// Ends a calibration, and returns when the robot has agreed. The result comes later, as an
    /// event.
    ///
    /// # Errors
    ///
    /// Same as [`start_calibration`](Self::start_calibration).
    pub $($async)? fn end_calibration(
        &mut self,
        kind: CalibrationKind,
        within: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.begin_calibration(CalibrationStep::End, kind)?;
        let outcome = self.until(deadline, Driver::calibration)$($await)*?;
        outcome.ok_or(DriveError::Timeout(Operation::Calibration))?
    }

    /// Keeps a command that was just given alive for `span`.
    $($async)? fn hold_command(
        &mut self,
        speed: i16,
        angular: i16,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let end = self.latest() + span;
        let refused = |driver: &mut Driver<_, _, _>| {
            driver.drop_routine();
            driver.command(speed, angular).err()
        };
        while self.now() < end {
            let next = self.renew_at().min(end);
            let kept = self.until_with(next, Needs::WholePortInTime, refused)$($await)*?;
            if let Some(error) = kept {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Runs until the stop has left, through errors of the port.
    $($async)? fn send_stop(&mut self) -> Result<(), DriveError<P::Error>> {
        let deadline = self.stop_deadline();
        let left = self.until_through_errors(deadline, Driver::stopped)$($await)*?;
        left.ok_or(DriveError::Timeout(Operation::Stop))
    }

    /// Runs until `done` returns a value; `None` at `deadline`. A port that fails ends it only
    /// then.
    $($async)? fn until_through_errors<T>(
        &mut self,
        deadline: Instant,
        mut done: impl FnMut(&mut Driver<Host<S>, P, C>) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            match self.until_with(deadline, Needs::HalfPort, &mut done)$($await)* {
                Err(error) if self.now() >= deadline => return Err(error),
                Err(_) => self.nap(deadline)$($await)*,
                found => return found,
            }
        }
    }
}

/// The calls of a robot.
impl<P: $($Port)+, C: $($Clock)+> $Driver<Robot, P, C> {
    /// Returns the current command, once it has changed since the last call, including a standstill
    /// by the watchdog. Answers and reports meanwhile; waits for this
    /// long, then returns `None`.
    ///
    /// # Errors
    ///
    /// Port errors. The command stays in force until its watchdog ends it: see
    /// [`Robot::command`].
    pub $($async)? fn next_command(
        &mut self,
        within: Duration,
    ) -> Result<Option<MotorControl>, DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.until_with(deadline, Needs::HalfPort, Driver::new_command)$($await)*
    }
}
};
}

in_both_worlds!(calls);
