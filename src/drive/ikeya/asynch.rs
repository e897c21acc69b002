//! The async motor-bus calls.

use super::calls::OnlineNodes;
use crate::drive::{driver::Driver, error::DriveError};
use crate::{
    drive::{
        clock::Clock,
        driver::{ERROR_NAP, Needs},
        error::Operation,
    },
    ikeya::{
        Master, NodeId, Slave,
        board::{Board, Status, Target},
        master::NodeSet,
    },
    time::Duration,
};

/// The async calls of a master: the same as the blocking ones, and cancel safe as the
/// [module](crate::drive) describes.
///
/// Once a call has been polled, its set-point is sent even if the call is cancelled, and a
/// cancelled stop is still owed. After a cancelled discovery or read, call it again.
impl<B: Board, P, C> Driver<Master<B>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Asks every id on the bus and returns the nodes that are online. Removes the events of the
    /// discovery itself.
    ///
    /// # Errors
    ///
    /// Port errors. It is not an error if no node answers.
    pub async fn discover_async(&mut self) -> Result<OnlineNodes, DriveError<P::Error>> {
        self.begin_discovery();
        let bound = self.bound();
        let found = self.until_async(bound, Self::discovered).await?;
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
    /// [`stop_async`](Self::stop_async), until the stop is confirmed: until then, set-points are
    /// refused with [`CommandError::StopOwed`](crate::ikeya::master::CommandError::StopOwed).
    pub async fn set_velocity_async(
        &mut self,
        node: NodeId,
        target: B::Velocity,
    ) -> Result<(), DriveError<P::Error>> {
        self.send_target_async(node, Target::Velocity(target)).await
    }

    /// Moves a position node, and returns when the command is on the line. The command is repeated
    /// as long as the driver is called, except with
    /// [`Polling::Manual`](crate::ikeya::master::Polling::Manual).
    ///
    /// # Errors
    ///
    /// Same as [`set_velocity_async`](Self::set_velocity_async).
    pub async fn set_position_async(
        &mut self,
        node: NodeId,
        target: B::Position,
    ) -> Result<(), DriveError<P::Error>> {
        self.send_target_async(node, Target::Position(target)).await
    }

    /// Turns a velocity node for `span`, then stops it and returns when it is seen to be
    /// still. Meanwhile the set-point is repeated, and counts as a sign of life; with
    /// [`Polling::Manual`](crate::ikeya::master::Polling::Manual) it is sent once, and the motor
    /// does not turn if it is lost.
    ///
    /// If the future is dropped, the stop is owed, and the next call sends it. **If there is no
    /// next call, the motor runs on.**
    ///
    /// # Errors
    ///
    /// Those of [`stop_async`](Self::stop_async), whatever else failed before. Otherwise
    /// the errors of [`set_velocity_async`](Self::set_velocity_async), returned at once if the node
    /// loses its set-point on the way.
    pub async fn drive_for_async(
        &mut self,
        node: NodeId,
        target: B::Velocity,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let target = Target::Velocity(target);
        self.role.check(node, &target)?;
        let guard = StopOnDrop { driver: self, node };
        let moved = match guard.driver.send_target_async(node, target).await {
            Ok(()) => guard.driver.hold_target_async(node, target, span).await,
            failed => failed,
        };
        drop(guard);
        self.await_stops_async(node.into()).await?;
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
    /// as long as the driver is called.
    pub async fn stop_async(
        &mut self,
        nodes: impl Into<NodeSet>,
    ) -> Result<(), DriveError<P::Error>> {
        let nodes = nodes.into();
        self.begin_stop(nodes);
        self.await_stops_async(nodes).await
    }

    /// Stops every node of [`MasterConfig::nodes`](crate::ikeya::master::MasterConfig::nodes), and
    /// every other node that has ever answered, as [`stop_async`](Self::stop_async) does.
    ///
    /// # Errors
    ///
    /// Those of [`stop_async`](Self::stop_async), with all nodes that they concern. The stops owed
    /// include ids that have never answered: only you know whether they have a motor. On a bus of
    /// fewer than eight nodes, set `MasterConfig::nodes`.
    pub async fn stop_all_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.begin_stop_all();
        self.await_stops_async(NodeSet::ALL).await
    }

    /// Reads a node; returns a measurement received after this call was made. Waits for at most
    /// four times [`Master::read_bound`].
    ///
    /// # Errors
    ///
    /// [`DriveError::ReadFailed`] after all attempts, [`DriveError::Bus`] for a node that is not
    /// online, and port errors.
    pub async fn read_async(&mut self, node: NodeId) -> Result<Status<B>, DriveError<P::Error>> {
        self.begin_read(node)?;
        let bound = self.bound();
        let answer = self.until_async(bound, |driver| driver.answer(node)).await?;
        answer.ok_or(DriveError::Timeout(Operation::Read { node }))?
    }

    async fn send_target_async(
        &mut self,
        node: NodeId,
        target: Target<B>,
    ) -> Result<(), DriveError<P::Error>> {
        self.aim(node, target)?;
        let bound = self.bound();
        let sent = self.until_async(bound, |driver| driver.aimed(node, target)).await;
        if !matches!(sent, Ok(Some(Ok(())))) {
            self.withdraw(node);
        }
        Ok(sent?.ok_or(DriveError::Timeout(Operation::SetPoint))??)
    }

    /// Keeps a set-point alive for `span`, as long as the node has it.
    async fn hold_target_async(
        &mut self,
        node: NodeId,
        target: Target<B>,
        span: Duration,
    ) -> Result<(), DriveError<P::Error>> {
        let end = self.now() + span;
        let lost = |driver: &mut Self| {
            driver.drop_readings();
            driver.still_aimed(node, target).err()
        };
        while self.now() < end {
            let next = self.keep_alive().min(end);
            let kept = self.until_with_async(next, Needs::WholePortInTime, lost).await?;
            if let Some(error) = kept {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Runs until these nodes are still, through errors of the port.
    async fn await_stops_async(&mut self, nodes: NodeSet) -> Result<(), DriveError<P::Error>> {
        let mut wait = self.wait_for_stops(nodes);
        loop {
            let until = wait.until(self.now());
            let result =
                self.until_async(until, |driver| driver.stopped::<P::Error>(&mut wait)).await;
            if let Some(stopped) = self.stopped(&mut wait) {
                return stopped;
            }
            if result.is_err() {
                // If the port fails at once, pause before the next attempt.
                self.clock.delay_us(ERROR_NAP.as_micros()).await;
            }
        }
    }
}

/// Makes a stop of the node due when a call ends, however it ends.
struct StopOnDrop<'a, B: Board, P, C: Clock> {
    driver: &'a mut Driver<Master<B>, P, C>,
    node: NodeId,
}

impl<B: Board, P, C: Clock> Drop for StopOnDrop<'_, B, P, C> {
    fn drop(&mut self) {
        self.driver.begin_stop(self.node.into());
    }
}

/// The async calls of a slave.
impl<B: Board, P, C> Driver<Slave<B>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Returns the next command, and answers requests meanwhile; waits for it for this long. `None`
    /// if there was none, and at once when the watchdog has fired: its event is then the next of
    /// [`poll_event`](Self::poll_event).
    ///
    /// # Errors
    ///
    /// Port errors.
    pub async fn next_command_async(
        &mut self,
        within: Duration,
    ) -> Result<Option<Target<B>>, DriveError<P::Error>> {
        let deadline = self.now() + within;
        self.until_with_async(deadline, Needs::HalfPort, Self::command).await.map(Option::flatten)
    }
}
