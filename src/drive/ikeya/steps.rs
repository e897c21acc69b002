//! The steps of the motor-bus calls, which wait for nothing.

use heapless::Vec;

#[cfg(feature = "embedded-io-async")]
use crate::drive::asynch;
use crate::drive::{clock::Clock, driver::Driver, error::DriveError};
use crate::{
    ikeya::{
        Master, Mode, NodeId, Slave,
        board::{Board, Status, Target},
        master::{CommandError, Health, MasterConfig, MasterEvent, NodeSet, StopProgress},
        slave::SlaveConfig,
    },
    time::{Duration, Instant},
};

/// The online nodes, in order of their ids, with their modes.
pub type OnlineNodes = Vec<(NodeId, Mode), 8>;

/// A call that waits until nodes are still.
pub(super) struct StopWait {
    nodes: NodeSet,
    /// Those of them whose stop has not been confirmed since the call.
    unconfirmed: NodeSet,
    confirmed_by: Instant,
    still_by: Instant,
}

impl StopWait {
    /// The next time limit.
    pub(super) fn until(&self, now: Instant) -> Instant {
        if now < self.confirmed_by { self.confirmed_by } else { self.still_by }
    }
}

impl<P, C: Clock> Driver<Master, P, C> {
    /// A new [master](Master) with a port and a clock. For another board, see
    /// [`with`](Driver::with).
    ///
    /// ```
    /// use axlewire::{drive::{Clock, DriveError, Driver}, ikeya::{NodeId, Rps, master::MasterConfig}};
    /// use axlewire::time::Duration;
    /// use embedded_io::{Read, ReadReady, Write};
    ///
    /// /// Turns node 1 for three seconds.
    /// fn turn<P, C>(port: P, clock: C) -> Result<(), DriveError<P::Error>>
    /// where
    ///     P: Read + ReadReady + Write,
    ///     C: Clock,
    /// {
    ///     let mut bus = Driver::master(MasterConfig::direct(), port, clock);
    ///     bus.discover()?;
    ///     bus.drive_for(NodeId::N1, Rps::new(2.0)?, Duration::from_secs(3))
    /// }
    /// ```
    pub fn master(config: MasterConfig, port: P, clock: C) -> Self {
        Self::with(|now| Master::new(config, now), port, clock)
    }
}

impl<P, C: Clock> Driver<Slave, P, C> {
    /// A new [slave](Slave) with a port and a clock. For another board, see
    /// [`with`](Driver::with).
    ///
    /// ```
    /// use axlewire::drive::{Clock, Driver};
    /// use axlewire::ikeya::{Mode, NodeId, Rps, Target, slave::SlaveConfig};
    /// use axlewire::time::Duration;
    /// use embedded_io::{Read, ReadReady, Write};
    ///
    /// /// Never returns: a motor must stop when the port fails, too.
    /// fn run<P, C>(port: P, clock: C, set: fn(Rps), measure: fn() -> Rps) -> !
    /// where
    ///     P: Read + ReadReady + Write,
    ///     C: Clock,
    /// {
    ///     let mut config = SlaveConfig::direct();
    ///     config.watchdog = Some(Duration::from_millis(100)); // off unless you set it
    ///     let mut slave = Driver::slave(NodeId::N1, Mode::Velocity, config, port, clock);
    ///     loop {
    ///         let _ = slave.next_command(Duration::from_millis(10)); // an error: show it
    ///         let now = slave.now();
    ///         match slave.role().command(now) {
    ///             Some(Target::Velocity(speed)) => set(speed),
    ///             _ => set(Rps::ZERO), // none yet, or the watchdog has fired
    ///         }
    ///         slave.role_mut().set_velocity(measure()); // what it answers
    ///     }
    /// }
    /// ```
    pub fn slave(node: NodeId, mode: Mode, config: SlaveConfig, port: P, clock: C) -> Self {
        Self::with(|now| Slave::new(node, mode, config, now), port, clock)
    }
}

impl<B: Board, P, C: Clock> Driver<Master<B>, P, C> {
    /// Deadline of a call: a discovery may run before it, each takes no longer than a read may, and
    /// a driver on a host is late now and then.
    pub(super) fn bound(&mut self) -> Instant {
        self.now() + self.role.read_bound().saturating_mul(4)
    }

    /// Begins to wait until these nodes are still.
    pub(super) fn wait_for_stops(&mut self, nodes: NodeSet) -> StopWait {
        let confirmed_by = self.now() + self.role.stop_bound();
        let still_by = confirmed_by + self.role.config().coast;
        StopWait { nodes, unconfirmed: nodes, confirmed_by, still_by }
    }

    pub(super) fn is_online(&self, node: NodeId) -> bool {
        matches!(self.role.health(node), Some(Health::Online | Health::Suspect(_)))
    }

    /// Nodes that were told to move.
    #[cfg(feature = "serialport")]
    pub(super) fn moving(&self) -> NodeSet {
        let is_moving = |&node: &NodeId| {
            self.role.set_point(node).is_some()
                && self.role.stop_progress(node) == StopProgress::NotAsked
        };
        NodeId::ALL.into_iter().filter(is_moving).collect()
    }

    pub(super) fn begin_discovery(&mut self) {
        let now = self.now();
        self.role.discover(now);
    }

    /// The online nodes, once the discovery is over; removes its events.
    pub(super) fn discovered(&mut self) -> Option<OnlineNodes> {
        self.role.retain_events(|event| {
            !matches!(
                event,
                MasterEvent::Discovered { .. }
                    | MasterEvent::DiscoveryDone { .. }
                    | MasterEvent::Status { .. }
            )
        });
        if self.role.is_discovering() {
            return None;
        }
        // Not `collect`: the compiler does not see that it cannot panic here.
        let mut found = Vec::new();
        for node in NodeId::ALL.into_iter().filter(|&node| self.is_online(node)) {
            if let Some(mode) = self.role.mode(node) {
                let _ = found.push((node, mode));
            }
        }
        Some(found)
    }

    /// Removes readings from the events: the role has the latest of each node.
    pub(super) fn drop_readings(&mut self) {
        self.role.retain_events(|event| !matches!(event, MasterEvent::Status { .. }));
    }

    pub(super) fn aim(&mut self, node: NodeId, target: Target<B>) -> Result<(), CommandError> {
        let now = self.now();
        match target {
            Target::Velocity(velocity) => self.role.set_velocity(node, velocity, now),
            Target::Position(position) => self.role.set_position(node, position, now),
        }
    }

    /// Whether the set-point has left, once that is known: it may be dropped while it waits.
    pub(super) fn aimed(
        &mut self,
        node: NodeId,
        target: Target<B>,
    ) -> Option<Result<(), CommandError>> {
        self.drop_readings();
        if let Err(error) = self.still_aimed(node, target) {
            return Some(Err(error));
        }
        (self.role.is_set_point_sent(node) && self.is_sent()).then_some(Ok(()))
    }

    /// Withdraws the set-point of a failed call, and the rest of a packet, which would complete a
    /// cut-off set-point. The node may have heard it anyway, and its previous order is gone: it is
    /// owed a stop.
    pub(super) fn withdraw(&mut self, node: NodeId) {
        let now = self.now();
        self.give_up(now);
        self.begin_stop(node.into());
    }

    /// Whether a node still has this set-point, and if not, why.
    pub(super) fn still_aimed(&self, node: NodeId, target: Target<B>) -> Result<(), CommandError> {
        if self.role.set_point(node) == Some(target) {
            return Ok(());
        }
        self.role.check(node, &target)?;
        Err(CommandError::NoSetPoint { node })
    }

    /// Requests a READ; readings from before do not count as its answer.
    pub(super) fn begin_read(&mut self, node: NodeId) -> Result<(), CommandError> {
        let now = self.now();
        self.drop_readings();
        self.role.read(node, now)
    }

    /// The answer of a node, or why there is none.
    pub(super) fn answer<E>(&mut self, node: NodeId) -> Option<Result<Status<B>, DriveError<E>>> {
        self.drop_readings();
        let outcome = self.role.read_outcome(node)?;
        let Err(cause) = outcome else {
            return self.role.status(node).map(|(status, _)| Ok(status));
        };
        self.role.retain_events(
            |event| !matches!(event, MasterEvent::ReadFailed { node: failed, .. } if *failed == node),
        );
        Some(Err(DriveError::ReadFailed { node, cause }))
    }

    pub(super) fn begin_stop(&mut self, nodes: NodeSet) {
        let now = self.now();
        self.ends_at = None;
        nodes.iter().for_each(|node| self.role.stop(node, now));
    }

    pub(super) fn begin_stop_all(&mut self) {
        let now = self.now();
        self.role.stop_all(now);
    }

    /// How the stops have ended, once they have: all nodes are still, or one is not confirmed or
    /// still in time.
    pub(super) fn stopped<E>(&mut self, wait: &mut StopWait) -> Option<Result<(), DriveError<E>>> {
        self.drop_readings();
        let now = self.now();
        let owed = self.role.stops_owed().and(wait.nodes);
        let coasting = self.role.coasting().and(wait.nodes);
        if owed.is_empty() && coasting.is_empty() {
            return Some(Ok(()));
        }
        // A node that loses its confirmation, by damage or another mode, has time to be still too.
        wait.unconfirmed = wait.unconfirmed.and(owed);
        if now >= wait.still_by || now >= wait.confirmed_by && !wait.unconfirmed.is_empty() {
            return Some(Err(match owed.is_empty() {
                true => DriveError::StillMoving(coasting),
                false => DriveError::StopsOwed(owed),
            }));
        }
        let is_moving = |node| self.role.stop_progress(node) == StopProgress::StillMoving;
        let are_moving = owed.is_empty() && coasting.iter().all(is_moving);
        are_moving.then_some(Err(DriveError::StillMoving(coasting)))
    }

    /// Gives a sign of life; returns when to give the next, well before the dead-man fires.
    pub(super) fn keep_alive(&mut self) -> Instant {
        let now = self.now();
        self.role.keep_alive(now);
        let limit = self.role.config().dead_man.map_or(u32::MAX, |limit| limit.as_micros() / 2);
        now + Duration::from_micros(limit.max(1))
    }
}

/// Longest time to send stops when a bus is dropped.
#[cfg(feature = "serialport")]
const DROP_BOUND: Duration = Duration::from_millis(100);

#[cfg(feature = "serialport")]
impl<B: Board, P, C: Clock> Driver<Master<B>, P, C>
where
    P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
{
    /// Tries for 100 ms to stop every node that was told to move or is owed a stop.
    pub(crate) fn try_stop(&mut self) {
        self.begin_stop(self.moving());
        let deadline = self.now() + DROP_BOUND;
        while self.now() < deadline {
            let stopped = |driver: &mut Self| {
                driver.drop_readings();
                driver.role.stops_owed().is_empty().then_some(())
            };
            match self.until(deadline, stopped) {
                Ok(_) => break,
                Err(_) => self.nap(deadline),
            }
        }
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P, C: Clock> asynch::Driver<Master, P, C> {
    /// A new [master](Master) with a port and a clock, as [`drive::Driver::master`].
    ///
    /// [`drive::Driver::master`]: Driver::master
    pub fn master(config: MasterConfig, port: P, clock: C) -> Self {
        Driver::master(config, port, clock).into()
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P, C: Clock> asynch::Driver<Slave, P, C> {
    /// A new [slave](Slave) with a port and a clock, as [`drive::Driver::slave`].
    ///
    /// [`drive::Driver::slave`]: Driver::slave
    pub fn slave(node: NodeId, mode: Mode, config: SlaveConfig, port: P, clock: C) -> Self {
        Driver::slave(node, mode, config, port, clock).into()
    }
}
