//! What a user of a motor bus wants first.

use heapless::Vec;

use super::{Clock, DriveError, Driver, Step, Wish};
use crate::{
    endpoint::Endpoint,
    ikeya::{
        Board, CommandError, Health, Master, MasterEvent, Mode, NodeId, Slave, SlaveEvent, Status,
        Target,
    },
    time::Instant,
};

/// The nodes that are online, in the order of their ids, and their modes.
pub type OnlineNodes = Vec<(NodeId, Mode), 8>;

/// What the blocking and the async calls have in common.
impl<B: Board, P, C: Clock> Driver<Master<B>, P, C> {
    /// When a call has taken too long: a discovery may be under way in front of it, each takes no
    /// longer than a read may, and a driver on a host comes late now and then.
    fn bound(&mut self) -> Instant {
        self.now() + self.role.read_bound().saturating_mul(4)
    }

    fn is_online(&self, node: NodeId) -> bool {
        matches!(self.role.health(node), Some(Health::Online | Health::Suspect(_)))
    }

    /// Takes out what a discovery tells; the nodes that are online once it is over.
    fn discovered(&mut self) -> Option<OnlineNodes> {
        let _: Option<()> = self.sift(|event| match event {
            MasterEvent::Discovered { .. } | MasterEvent::DiscoveryDone { .. } => Step::Drop,
            event => unread(event),
        });
        if self.role.is_discovering() {
            return None;
        }
        let online = NodeId::ALL.into_iter().filter(|&node| self.is_online(node));
        Some(gathered(online.filter_map(|node| Some((node, self.role.mode(node)?)))))
    }

    /// Has every set-point been sent?
    fn is_all_sent(&self) -> bool {
        !self.role.has_unsent_targets() && self.unsent.is_empty()
    }

    /// A set-point is dropped when its node turns out to be abnormal while it waits to be sent.
    fn was_sent(&self, node: NodeId) -> Result<(), CommandError> {
        self.is_online(node).then_some(()).ok_or(CommandError::NotOnline { node })
    }

    /// Asks for a READ; what was heard before is not its answer.
    fn begin_read(&mut self, node: NodeId) -> Result<(), CommandError> {
        self.was_sent(node)?;
        let _: Option<()> = self.sift(unread);
        self.role.read(node)
    }

    /// The answer of a node, or why there is none.
    fn answer<E>(&mut self, asked: NodeId) -> Option<Result<Status<B>, DriveError<E>>> {
        self.sift(|event| match event {
            MasterEvent::Status { node, status } if node == asked => Step::Found(Ok(status)),
            MasterEvent::ReadFailed { node, cause } if node == asked => {
                Step::Found(Err(DriveError::ReadFailed { node, cause }))
            }
            event => unread(event),
        })
    }

    fn known(&self) -> Vec<NodeId, 8> {
        gathered(NodeId::ALL.into_iter().filter(|&node| self.role.mode(node).is_some()))
    }

    /// Gives every node that is online its stop; those for which there is none.
    fn begin_stop(&mut self, nodes: &[NodeId]) -> Vec<NodeId, 8> {
        gathered(nodes.iter().copied().filter(|&node| self.role.stop(node).is_err()))
    }

    /// Adds the nodes that are not online, and may not have heard their stop.
    fn not_stopped(&self, nodes: &[NodeId], mut failed: Vec<NodeId, 8>) -> Vec<NodeId, 8> {
        for &node in nodes {
            if !self.is_online(node) && !failed.contains(&node) {
                // There is room: no node is in it twice.
                let _ = failed.push(node);
            }
        }
        failed
    }
}

/// As many as there are nodes, at the most. Not by `collect`: the compiler does not see that it
/// cannot panic here.
fn gathered<T>(items: impl Iterator<Item = T>) -> Vec<T, 8> {
    let mut gathered = Vec::new();
    for item in items {
        let _ = gathered.push(item);
    }
    gathered
}

/// Readings are left out of what is kept: the master has the latest of each node.
fn unread<B: Board, T>(event: MasterEvent<B>) -> Step<T, MasterEvent<B>> {
    match event {
        MasterEvent::Status { .. } => Step::Drop,
        event => Step::Keep(event),
    }
}

impl<B: Board, P, C: Clock> Driver<Slave<B>, P, C> {
    /// A command; or its absence, whose event stays to be taken out.
    fn command(&mut self) -> Option<Option<Target<B>>> {
        match self.role.poll_event()? {
            SlaveEvent::Command(target) => Some(Some(target)),
            event => {
                self.keep(event);
                Some(None)
            }
        }
    }
}

/// The blocking calls of a master.
///
/// Each ends within four times [`Master::read_bound`]. Readings that come in meanwhile are not
/// kept as events, because [`Master::status`] has the latest; all other events are.
#[cfg(feature = "embedded-io")]
impl<B: Board, P, C: Clock> Driver<Master<B>, P, C>
where
    P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
{
    /// Asks every id from 1 to 8 and says who is online. The events of the discovery itself are
    /// taken out.
    ///
    /// # Errors
    ///
    /// Those of the port. That nobody is there is no error.
    pub fn discover(&mut self) -> Result<OnlineNodes, DriveError<P::Error>> {
        self.role.discover();
        let bound = self.bound();
        self.until(bound, Self::discovered)?.ok_or(DriveError::Timeout(Wish::Discovery))
    }

    /// Turns a velocity node, and returns when the command is on the line. It is repeated as long as
    /// the driver is called.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub fn set_velocity(
        &mut self,
        node: NodeId,
        target: B::Velocity,
    ) -> Result<(), DriveError<P::Error>> {
        self.role.set_velocity(node, target)?;
        self.send_set_points()?;
        Ok(self.was_sent(node)?)
    }

    /// Moves a position node, and returns when the command is on the line. It is repeated as long as
    /// the driver is called.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub fn set_position(
        &mut self,
        node: NodeId,
        target: B::Position,
    ) -> Result<(), DriveError<P::Error>> {
        self.role.set_position(node, target)?;
        self.send_set_points()?;
        Ok(self.was_sent(node)?)
    }

    /// Stops a node as [`Master::stop`] does, and returns when the command is on the line.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub fn stop(&mut self, node: NodeId) -> Result<(), DriveError<P::Error>> {
        self.role.stop(node)?;
        self.send_set_points()
    }

    /// Stops every node that has ever answered, and returns when the commands are on the line; says
    /// which nodes are not online and may not have heard theirs, or have told no position to hold.
    ///
    /// # Errors
    ///
    /// Those of the port: then nothing is known to have stopped.
    pub fn stop_all(&mut self) -> Result<Vec<NodeId, 8>, DriveError<P::Error>> {
        let nodes = self.known();
        let failed = self.begin_stop(&nodes);
        self.send_set_points()?;
        Ok(self.not_stopped(&nodes, failed))
    }

    /// What a node measures, heard after this call was made.
    ///
    /// # Errors
    ///
    /// [`DriveError::ReadFailed`] after all attempts, [`DriveError::Bus`] for a node that is not
    /// online, and those of the port.
    pub fn read(&mut self, node: NodeId) -> Result<Status<B>, DriveError<P::Error>> {
        self.begin_read(node)?;
        let bound = self.bound();
        self.until(bound, |driver| driver.answer(node))?
            .ok_or(DriveError::Timeout(Wish::Read { node }))?
    }

    fn send_set_points(&mut self) -> Result<(), DriveError<P::Error>> {
        let bound = self.bound();
        self.until(bound, |driver| driver.is_all_sent().then_some(()))?
            .ok_or(DriveError::Timeout(Wish::SetPoint))
    }
}

/// The blocking calls of a slave.
#[cfg(feature = "embedded-io")]
impl<B: Board, P, C: Clock> Driver<Slave<B>, P, C>
where
    P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady,
{
    /// The next command; answers meanwhile. `None` at `deadline`, and at once when the watchdog has
    /// barked: its event is then the next of [`poll_event`](Self::poll_event).
    ///
    /// # Errors
    ///
    /// Those of the port.
    pub fn next_command(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<Target<B>>, DriveError<P::Error>> {
        self.until(deadline, Self::command).map(Option::flatten)
    }
}

/// The async calls of a master: the same, and as cancel safe as the [module](super) says. A cancelled
/// command has been taken and will be sent; a cancelled discovery or read is asked for anew.
#[cfg(feature = "embedded-io-async")]
impl<B: Board, P, C> Driver<Master<B>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// Asks every id from 1 to 8 and says who is online. The events of the discovery itself are
    /// taken out.
    ///
    /// # Errors
    ///
    /// Those of the port. That nobody is there is no error.
    pub async fn discover_async(&mut self) -> Result<OnlineNodes, DriveError<P::Error>> {
        self.role.discover();
        let bound = self.bound();
        let found = self.until_async(bound, Self::discovered).await?;
        found.ok_or(DriveError::Timeout(Wish::Discovery))
    }

    /// Turns a velocity node, and returns when the command is on the line. It is repeated as long as
    /// the driver is called.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub async fn set_velocity_async(
        &mut self,
        node: NodeId,
        target: B::Velocity,
    ) -> Result<(), DriveError<P::Error>> {
        self.role.set_velocity(node, target)?;
        self.send_set_points_async().await?;
        Ok(self.was_sent(node)?)
    }

    /// Moves a position node, and returns when the command is on the line. It is repeated as long as
    /// the driver is called.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub async fn set_position_async(
        &mut self,
        node: NodeId,
        target: B::Position,
    ) -> Result<(), DriveError<P::Error>> {
        self.role.set_position(node, target)?;
        self.send_set_points_async().await?;
        Ok(self.was_sent(node)?)
    }

    /// Stops a node as [`Master::stop`] does, and returns when the command is on the line.
    ///
    /// # Errors
    ///
    /// [`DriveError::Bus`], and those of the port.
    pub async fn stop_async(&mut self, node: NodeId) -> Result<(), DriveError<P::Error>> {
        self.role.stop(node)?;
        self.send_set_points_async().await
    }

    /// Stops every node that has ever answered, and returns when the commands are on the line; says
    /// which nodes are not online and may not have heard theirs, or have told no position to hold.
    ///
    /// # Errors
    ///
    /// Those of the port: then nothing is known to have stopped.
    pub async fn stop_all_async(&mut self) -> Result<Vec<NodeId, 8>, DriveError<P::Error>> {
        let nodes = self.known();
        let failed = self.begin_stop(&nodes);
        self.send_set_points_async().await?;
        Ok(self.not_stopped(&nodes, failed))
    }

    /// What a node measures, heard after this call was made.
    ///
    /// # Errors
    ///
    /// [`DriveError::ReadFailed`] after all attempts, [`DriveError::Bus`] for a node that is not
    /// online, and those of the port.
    pub async fn read_async(&mut self, node: NodeId) -> Result<Status<B>, DriveError<P::Error>> {
        self.begin_read(node)?;
        let bound = self.bound();
        let answer = self.until_async(bound, |driver| driver.answer(node)).await?;
        answer.ok_or(DriveError::Timeout(Wish::Read { node }))?
    }

    async fn send_set_points_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let bound = self.bound();
        let sent = self.until_async(bound, |driver| driver.is_all_sent().then_some(())).await?;
        sent.ok_or(DriveError::Timeout(Wish::SetPoint))
    }
}

/// The async calls of a slave.
#[cfg(feature = "embedded-io-async")]
impl<B: Board, P, C> Driver<Slave<B>, P, C>
where
    P: embedded_io_async::Read + embedded_io_async::Write,
    C: Clock + embedded_hal_async::delay::DelayNs,
{
    /// The next command; answers meanwhile. `None` at `deadline`, and at once when the watchdog has
    /// barked: its event is then the next of [`poll_event`](Self::poll_event).
    ///
    /// # Errors
    ///
    /// Those of the port.
    pub async fn next_command_async(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<Target<B>>, DriveError<P::Error>> {
        self.until_async(deadline, Self::command).await.map(Option::flatten)
    }
}
