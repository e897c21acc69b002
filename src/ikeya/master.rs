//! The master of a motor bus: who is asked when, what an answer is, and who is well.

mod config;
mod event;
mod hear;
mod node;
mod send;

pub use config::{MasterConfig, Polling};
pub use event::{Cause, CommandError, MasterEvent, MasterStatistics};
pub use node::{Health, NodeStatistics};

use heapless::{Deque, Vec};

use self::node::{Confirm, Node};
use super::{Board, Mode, NodeId, OneMotor, ReadRequest, Status, Target};
use crate::{
    endpoint::Endpoint,
    stream::{Counters, Decoder},
    time::{Duration, Instant, wire_time},
};

/// Strikes after which a node is abnormal (ruling I7).
const STRIKES: u8 = 3;

/// Events that wait for the application at the most.
const EVENTS: usize = 16;

/// Longest packet of either kind of board, bytes.
const PACKET_LEN: usize = 16;

/// Bytes of its own that a master on a 2-wire line waits to hear again at the most.
const ECHO_LEN: usize = 64;

/// The master: discovers nodes, repeats the latest set-points, reads every node in turn, and never
/// takes for an answer what is none.
///
/// It knows neither clock nor port; see [`Endpoint`] for who calls what when. A cycle visits every
/// node that is online: a WRITE if it has a set-point, then a READ (I8). With
/// [`ThreeMotors`](super::ThreeMotors) the WRITE is answered and is the READ as well (I10).
///
/// # Answers
///
/// A READ opens a window that ends [`MasterConfig::reply_timeout`] plus the answer's wire time after
/// the request has left the line (I7). What is heard outside, or from another node, is counted as
/// late and dropped. An answer in another mode than the node's is believed the second time in a
/// row, and then ends the set-point: it was meant for the other mode.
///
/// A node that did not answer is not asked again for [`MasterConfig::late_guard`], so that a late
/// answer meets a closed window. An answer later than that cannot be told from the next one: the
/// protocol has no numbers.
///
/// # Health
///
/// A window without the answer is a strike, whatever else was heard in it. Three in a row and the
/// node is abnormal, one answer and it is online again; a WRITE changes nothing (I7). The set-point
/// of a node that becomes abnormal is dropped: a board that comes back after an unknown while shall
/// not move until somebody says so.
///
/// Nobody can help a switch that is moved while a command is on its way: the node reads it in its
/// new mode. Move it on a machine that stands still.
///
/// ```
/// use axlewire::{endpoint::Endpoint, ikeya::{Master, MasterConfig}, time::Instant};
///
/// let mut master: Master = Master::new(MasterConfig::direct());
/// master.discover();
/// let now = Instant::from_micros(0);
/// assert_eq!(master.poll_transmit(now), Some(&[0xAA, 0x01, 0xBE, 0xD0][..])); // READ 1
/// assert_eq!(master.poll_transmit(now), None); // until the window closes
/// assert_eq!(master.poll_timeout(), Some(Instant::from_micros(80 + 500 + 160)));
/// ```
#[derive(Debug)]
pub struct Master<B: Board = OneMotor> {
    config: MasterConfig,
    nodes: [Node<B>; 8],
    state: State,
    /// Time of the last call.
    now: Instant,
    /// When the bytes handed out for sending have left, and the gap behind them is over.
    line_free: Option<Instant>,
    /// The last packet was a WRITE that is not answered: a READ may follow without a pause.
    is_behind_write: bool,
    /// The node whose turn it is, as an index.
    turn: usize,
    /// The id to be asked next, while ids are looked for.
    discovery: Option<Discovery>,
    /// Not before then is another abnormal node asked.
    probe_at: Option<Instant>,
    probe_turn: usize,
    decoder: Decoder<B::ToMaster, PACKET_LEN>,
    packet: Vec<u8, PACKET_LEN>,
    echo: Deque<u8, ECHO_LEN>,
    events: Deque<MasterEvent<B>, EVENTS>,
    statistics: MasterStatistics,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// Nobody has been asked.
    Idle,
    /// A node has been asked and may answer until `deadline`.
    Awaiting { node: NodeId, request_end: Instant, deadline: Instant, heard: Heard },
}

/// What has been heard in the window that is open.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Heard {
    Nothing,
    Bytes,
    Others,
}

#[derive(Clone, Copy, Debug)]
struct Discovery {
    pass: u8,
    next: usize,
}

impl<B: Board> Master<B> {
    /// A master that knows no nodes yet: [`discover`](Self::discover) them.
    #[must_use]
    pub fn new(config: MasterConfig) -> Self {
        Self {
            config,
            nodes: core::array::from_fn(|_| Node::new()),
            state: State::Idle,
            now: Instant::from_micros(0),
            line_free: None,
            is_behind_write: false,
            turn: 0,
            discovery: None,
            probe_at: None,
            probe_turn: 0,
            decoder: Decoder::new(),
            packet: Vec::new(),
            echo: Deque::new(),
            events: Deque::new(),
            statistics: MasterStatistics::default(),
        }
    }

    /// Asks every id from 1 to 8 that is not online: one READ each, silent ids again until
    /// [`MasterConfig::attempts`]. Ends with [`MasterEvent::DiscoveryDone`].
    pub fn discover(&mut self) {
        for node in &mut self.nodes {
            node.scans = 0;
        }
        self.discovery = Some(Discovery { pass: 0, next: 0 });
        self.settle_discovery();
    }

    /// Turns a velocity node at `target` from the next cycle on. The latest set-point wins.
    ///
    /// # Errors
    ///
    /// [`CommandError`]: the node is not online or not in velocity mode.
    pub fn set_velocity(&mut self, node: NodeId, target: B::Velocity) -> Result<(), CommandError> {
        self.online(node, Mode::Velocity)?.aim(Target::Velocity(target));
        Ok(())
    }

    /// Moves a position node to `target` from the next cycle on. The latest set-point wins.
    ///
    /// # Errors
    ///
    /// [`CommandError`]: the node is not online or not in position mode.
    pub fn set_position(&mut self, node: NodeId, target: B::Position) -> Result<(), CommandError> {
        self.online(node, Mode::Position)?.aim(Target::Position(target));
        Ok(())
    }

    /// Stops a node: 0 rps, or *hold at the last measured position*, never "go to 0" (ruling I6).
    ///
    /// Goes to an abnormal node as well, once: it may still hear what it can no longer answer.
    ///
    /// # Errors
    ///
    /// [`CommandError`]: the node has never answered, or has not told a position yet.
    pub fn stop(&mut self, node: NodeId) -> Result<(), CommandError> {
        let target = match (self.mode(node), self.status(node)) {
            (None, _) => return Err(CommandError::NotOnline { node }),
            (Some(Mode::Velocity), _) => Target::Velocity(B::ZERO),
            (_, Some((Status::Position(held), _))) => Target::Position(held),
            _ => return Err(CommandError::NoPosition { node }),
        };
        let node = self.node_mut(node);
        node.aim(target);
        node.is_stop = true;
        Ok(())
    }

    /// Stops every node that has ever answered; says how many could not be stopped.
    pub fn stop_all(&mut self) -> usize {
        let failed = |node: &NodeId| self.mode(*node).is_some() && self.stop(*node).is_err();
        NodeId::ALL.into_iter().filter(failed).count()
    }

    /// Sends no more set-points to a node. It keeps the last one that it has received.
    pub fn release(&mut self, node: NodeId) {
        self.node_mut(node).forget_target();
    }

    /// Asks for [`MasterEvent::Confirmed`] once the node has answered a READ that followed the next
    /// WRITE to it (ruling I8).
    ///
    /// # Errors
    ///
    /// [`CommandError::NotOnline`].
    pub fn confirm(&mut self, node: NodeId) -> Result<(), CommandError> {
        if !self.node(node).is_online() {
            return Err(CommandError::NotOnline { node });
        }
        self.node_mut(node).confirm = Confirm::AfterWrite;
        Ok(())
    }

    /// Reads a node once more than the polling does: the way to read with [`Polling::Manual`].
    ///
    /// Comes to [`MasterEvent::Status`] or [`MasterEvent::ReadFailed`].
    ///
    /// # Errors
    ///
    /// [`CommandError::NotOnline`].
    pub fn read(&mut self, node: NodeId) -> Result<(), CommandError> {
        if !self.node(node).is_online() {
            return Err(CommandError::NotOnline { node });
        }
        self.node_mut(node).asked = true;
        Ok(())
    }

    /// How a node is; `None` if it has never answered.
    #[must_use]
    pub fn health(&self, node: NodeId) -> Option<Health> {
        self.node(node).health
    }

    /// The mode of a node; `None` if it has never answered.
    #[must_use]
    pub fn mode(&self, node: NodeId) -> Option<Mode> {
        self.node(node).mode
    }

    /// What a node measured last, and when that was heard.
    #[must_use]
    pub fn status(&self, node: NodeId) -> Option<(Status<B>, Instant)> {
        self.node(node).status
    }

    /// The counts of a node.
    #[must_use]
    pub fn node_statistics(&self, node: NodeId) -> &NodeStatistics {
        &self.node(node).statistics
    }

    /// The counts of the line.
    #[must_use]
    pub const fn statistics(&self) -> &MasterStatistics {
        &self.statistics
    }

    /// Where every byte went.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.decoder.counters()
    }

    /// Is there a set-point that has not been sent once yet?
    #[must_use]
    pub fn has_unsent_targets(&self) -> bool {
        self.nodes.iter().any(|node| node.fresh)
    }

    /// Is a discovery under way?
    #[must_use]
    pub const fn is_discovering(&self) -> bool {
        self.discovery.is_some()
    }

    /// Longest time from the first request of a READ to its answer or its
    /// [failure](MasterEvent::ReadFailed), on any line, where the driver is called in time and no
    /// discovery is under way, which goes first.
    ///
    /// Between two attempts lie the guard, one exchange with each other node, the search for an
    /// abnormal one, and a new set-point for every node.
    #[must_use]
    pub fn read_bound(&self) -> Duration {
        let gap = self.config.turnaround_gap;
        let write = wire_time(PACKET_LEN, self.config.baud) + gap;
        let exchange = write + self.window() + gap;
        let attempt = self.config.late_guard + exchange.saturating_mul(9) + write.saturating_mul(8);
        attempt.saturating_mul(self.config.attempts.max(1).into())
    }

    fn node(&self, node: NodeId) -> &Node<B> {
        &self.nodes[index_of(node)]
    }

    fn node_mut(&mut self, node: NodeId) -> &mut Node<B> {
        &mut self.nodes[index_of(node)]
    }

    /// The node, if it may be commanded in this mode.
    fn online(&mut self, id: NodeId, wanted: Mode) -> Result<&mut Node<B>, CommandError> {
        let node = self.node_mut(id);
        match node.mode {
            _ if !node.is_online() => Err(CommandError::NotOnline { node: id }),
            Some(mode) if mode != wanted => Err(CommandError::WrongMode { node: id, mode }),
            _ => Ok(node),
        }
    }

    fn tell(&mut self, event: MasterEvent<B>) {
        if self.events.push_back(event).is_err() {
            self.statistics.lost_events = self.statistics.lost_events.wrapping_add(1);
        }
    }
}

/// Eight ids, eight nodes; the mask lets the compiler see it.
const fn index_of(node: NodeId) -> usize {
    (node.get() as usize - 1) & 7
}

/// What is sent.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Request {
    Read,
    Write,
}

impl<B: Board> Endpoint for Master<B> {
    type Event = MasterEvent<B>;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.now = now;
        let mut bytes = self.without_echo(bytes);
        if let State::Awaiting { heard: heard @ Heard::Nothing, .. } = &mut self.state {
            *heard = if bytes.is_empty() { Heard::Nothing } else { Heard::Bytes };
        }
        while let Some((node, status)) = self.next_response(&mut bytes) {
            self.hear(node, status, now);
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.now = now;
        let State::Awaiting { node, deadline, heard, .. } = self.state else { return };
        if now >= deadline {
            let cause = match heard {
                Heard::Nothing => Cause::Silent,
                Heard::Bytes => Cause::Damaged,
                Heard::Others => Cause::Unexpected,
            };
            self.state = State::Idle;
            self.strike(node, cause, deadline);
            self.settle_discovery();
        }
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.now = now;
        if matches!(self.state, State::Awaiting { .. }) {
            return None;
        }
        let (node, request) = self.next_request(now)?;
        self.encode(node, request)?;
        let request_end = self.line_free.map_or(now, |free| free.max(now))
            + wire_time(self.packet.len(), self.config.baud);
        self.line_free = Some(request_end + self.config.turnaround_gap);
        let count = match request {
            Request::Read => &mut self.statistics.reads,
            Request::Write => &mut self.statistics.writes,
        };
        *count = count.wrapping_add(1);
        let is_answered = request == Request::Read || B::ANSWERS_WRITE;
        self.is_behind_write = !is_answered && self.config.turnaround_gap == Duration::ZERO;
        if is_answered {
            self.open(node, request_end);
        }
        self.expect_echo();
        Some(&self.packet)
    }

    fn poll_event(&mut self) -> Option<MasterEvent<B>> {
        self.events.pop_front()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        if let State::Awaiting { deadline, .. } = self.state {
            return Some(deadline);
        }
        let due = self.due()?;
        let free = self.line_free.unwrap_or(due);
        Some(due.max(free))
    }
}
