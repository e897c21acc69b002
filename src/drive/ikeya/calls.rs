//! The motor-bus calls, written once for both worlds.

use crate::{
    drive::{
        clock::Clock,
        driver::{Driver, Needs},
        error::{DriveError, Operation},
        worlds::AtEnd,
    },
    ikeya::{
        Master, NodeId, Slave,
        board::{Board, Status, Target},
        master::NodeSet,
        slave::SlaveEvent,
    },
    time::{Duration, Instant},
};

use super::steps::OnlineNodes;

macro_rules! calls {
    ($Driver:ident, [$($Port:tt)+], [$($Clock:tt)+], [$($async:tt)?], [$($await:tt)*]) => {
/// The calls of a master.
///
/// Each ends within four times [`Master::read_bound`], behind its span if it has one; those that
/// stop within [`Master::stop_bound`] and the time to coast. Readings received meanwhile are not kept as
/// events, because [`Master::status`] has the latest; all other events are kept.
impl<B: Board, P: $($Port)+, C: $($Clock)+> $Driver<Master<B>, P, C> {
    /// Asks every id on the bus and returns the nodes that are online. Removes the events of the
    /// discovery itself.
    ///
    /// # Errors
    ///
    /// Port errors, and [`DriveError::Timeout`] if a port that is too slow did not let it end in
    /// time. It is not an error if no node answers.
    pub $($async)? fn discover(&mut self) -> Result<OnlineNodes, DriveError<P::Error>> {
        self.begin_discovery();
        let bound = self.bound();
        let found = self.until(bound, Driver::discovered)$($await)*?;
        found.ok_or(DriveError::Timeout(Operation::Discovery))
    }

    /// Turns a velocity node, and returns when the command is on the line. The command is repeated
    /// as long as the driver is called, except with
    /// [`Polling::Manual`](crate::ikeya::master::Polling::Manual).
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`] if the master refuses the command, or drops it before it was sent;
    /// [`DriveError::Timeout`] if it could not be sent within four times [`Master::read_bound`];
    /// and port errors, even if only its receiver failed. After any of them but a refusal the
    /// command is withdrawn: neither it nor its rest is sent later, and **the node is owed a stop**
    /// (ruling I12), because it may have heard the command. Keep calling the driver, or call
    /// [`stop`](Self::stop), until the stop is confirmed: until then, set-points are refused with
    /// [`CommandError::StopOwed`](crate::ikeya::master::CommandError::StopOwed).
    pub $($async)? fn set_velocity(
        &mut self,
        node: NodeId,
        target: B::Velocity,
    ) -> Result<(), DriveError<P::Error>> {
        self.send_target(node, Target::Velocity(target), None)$($await)*
    }

    /// Moves a position node, and returns when the command is on the line. The command is repeated
    /// as long as the driver is called, except with
    /// [`Polling::Manual`](crate::ikeya::master::Polling::Manual).
    ///
    /// # Errors
    ///
    /// Same as [`set_velocity`](Self::set_velocity).
    pub $($async)? fn set_position(
        &mut self,
        node: NodeId,
        target: B::Position,
    ) -> Result<(), DriveError<P::Error>> {
        self.send_target(node, Target::Position(target), None)$($await)*
    }

    /// Turns a velocity node up to `span` after the call, then stops it and returns when it is seen
    /// to be still. Meanwhile the set-point is repeated, and counts as a sign of life; with
    /// [`Polling::Manual`](crate::ikeya::master::Polling::Manual) it is sent once, and the motor
    /// does not turn if it is lost.
    ///
    /// # Errors
    ///
    /// Those of [`stop`](Self::stop), whatever else failed before. Otherwise the errors of
    /// [`set_velocity`](Self::set_velocity), returned at once if the node loses its set-point on
    /// the way, and [`DriveError::Timeout`] if the set-point could not be sent within `span`: it is
    /// not sent later. A port that holds a READ back in its flush delays the stop, by a second at
    /// most.
    pub $($async)? fn drive_for(
        &mut self,
        node: NodeId,
        target: B::Velocity,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let (target, end) = (Target::Velocity(target), self.now() + span);
        self.role.check(node, &target)?;
        let guard = AtEnd { driver: self, then: |driver| driver.begin_stop(node.into()) };
        let moved = match guard.driver.send_target(node, target, Some(end))$($await)* {
            Ok(()) => guard.driver.hold_target(node, target, end)$($await)*,
            failed => failed,
        };
        drop(guard);
        self.await_stops(node.into())$($await)*?;
        moved
    }

    /// Stops a node, or all of a [`NodeSet`], as [`Master::stop`] does, and returns when each is
    /// **seen to be still** ([`StopProgress::StandingStill`](crate::ikeya::master::StopProgress),
    /// ruling I12). Continues through errors of the port.
    ///
    /// To go on with other work meanwhile, call [`Master::stop`], keep calling the driver, and
    /// watch [`Master::stop_progress`].
    ///
    /// # Errors
    ///
    /// [`DriveError::StopsOwed`] if the stop is not confirmed within [`Master::stop_bound`], and
    /// [`DriveError::StillMoving`] if the motor moves for longer than
    /// [`MasterConfig::coast`](crate::ikeya::master::MasterConfig::coast) after it is. The call
    /// ends after the sum of both at the latest. **The motor may be running.** The stop is repeated
    /// as long as the driver is called. An error of the port is not returned: a stop that it kept
    /// from the node is among those owed.
    pub $($async)? fn stop(
        &mut self,
        nodes: impl Into<NodeSet>,
    ) -> Result<(), DriveError<P::Error>> {
        let nodes = nodes.into();
        self.begin_stop(nodes);
        self.await_stops(nodes)$($await)*
    }

    /// Stops every node of [`MasterConfig::nodes`](crate::ikeya::master::MasterConfig::nodes), and
    /// every other node that has ever answered, as [`stop`](Self::stop) does.
    ///
    /// # Errors
    ///
    /// Those of [`stop`](Self::stop), with all nodes that they concern. The stops owed include
    /// ids that have never answered: only you know whether they have a motor. On a bus of fewer
    /// than eight nodes, set `MasterConfig::nodes`.
    pub $($async)? fn stop_all(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop_all();
        self.await_stops(NodeSet::ALL)$($await)*
    }

    /// Reads a node; returns a measurement received after this call was made. Waits for at most
    /// four times [`Master::read_bound`].
    ///
    /// # Errors
    ///
    /// [`DriveError::ReadFailed`] after all attempts, [`DriveError::Bus`] for a node that is not
    /// online, [`DriveError::Timeout`] if a port that is too slow did not let it be asked, and port
    /// errors.
    pub $($async)? fn read(&mut self, node: NodeId) -> Result<Status<B>, DriveError<P::Error>> {
        self.begin_read(node)?;
        let bound = self.bound();
        let answer = self.until(bound, |driver| driver.answer(node))$($await)*?;
        answer.ok_or(DriveError::Timeout(Operation::Read { node }))?
    }

    $($async)? fn send_target(
        &mut self,
        node: NodeId,
        target: Target<B>,
        end: Option<Instant>,
    ) -> Result<(), DriveError<P::Error>> {
        self.aim(node, target)?;
        let bound = self.bound();
        let (by, needs) = match end {
            Some(end) => (end.min(bound), Needs::WholePortInTime),
            None => (bound, Needs::WholePort),
        };
        let aimed = |driver: &mut Driver<_, _, _>| driver.aimed(node, target);
        let sent = self.until_with(by, needs, aimed)$($await)*;
        if !matches!(sent, Ok(Some(Ok(())))) {
            self.withdraw(node);
        }
        Ok(sent?.ok_or(DriveError::Timeout(Operation::SetPoint))??)
    }

    /// Keeps a set-point alive up to this time, as long as the node has it.
    $($async)? fn hold_target(
        &mut self,
        node: NodeId,
        target: Target<B>,
        end: Instant,
    ) -> Result<(), DriveError<P::Error>> {
        let lost = |driver: &mut Driver<_, _, _>| {
            driver.drop_readings();
            driver.still_aimed(node, target).err()
        };
        while self.now() < end {
            let next = self.keep_alive().min(end);
            let kept = self.until_with(next, Needs::WholePortInTime, lost)$($await)*?;
            if let Some(error) = kept {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Runs until these nodes are still, through errors of the port.
    $($async)? fn await_stops(&mut self, nodes: NodeSet) -> Result<(), DriveError<P::Error>> {
        let mut wait = self.wait_for_stops(nodes);
        loop {
            let until = wait.until(self.now());
            let stopped = |driver: &mut Driver<_, _, _>| driver.stopped::<P::Error>(&mut wait);
            let result = self.until(until, stopped)$($await)*;
            if let Some(stopped) = self.stopped(&mut wait) {
                return stopped;
            }
            if result.is_err() {
                self.nap(until)$($await)*;
            }
        }
    }
}

/// The calls of a slave.
impl<B: Board, P: $($Port)+, C: $($Clock)+> $Driver<Slave<B>, P, C> {
    /// Returns the next command, or that the watchdog has ended the last one; answers requests
    /// meanwhile, and waits for this long, then returns `None`. What is in force at any time is
    /// [`Slave::command`].
    ///
    /// # Errors
    ///
    /// Port errors.
    pub $($async)? fn next_command(
        &mut self,
        within: Duration,
    ) -> Result<Option<SlaveEvent<B>>, DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.until_with(deadline, Needs::HalfPort, Driver::poll_event)$($await)*
    }
}
};
}

in_both_worlds!(calls);
