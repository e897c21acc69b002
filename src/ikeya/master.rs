//! The master of a motor bus: who is asked when, what an answer is, and who is well.

mod config;
mod node;

pub use config::{MasterConfig, Polling};
pub use node::{Health, NodeStatistics};

use core::fmt;

use heapless::{Deque, Vec};

use self::node::{Confirm, Due, Node, Target};
use super::{Board, Mode, NodeId, OneMotor, ReadRequest, Status};
use crate::{
    endpoint::Endpoint,
    stream::{Decoder, Encode, Event, Framing},
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

/// What the master tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MasterEvent<B: Board = OneMotor> {
    /// A node has answered for the first time.
    Discovered {
        /// Which.
        node: NodeId,
        /// Its mode.
        mode: Mode,
    },
    /// Every id has been asked.
    DiscoveryDone {
        /// How many nodes are online now.
        online: u8,
    },
    /// A node has answered.
    Status {
        /// Which.
        node: NodeId,
        /// What it measures.
        status: Status<B>,
    },
    /// A READ was given up.
    ReadFailed {
        /// Which node did not answer.
        node: NodeId,
        /// What was heard instead, the last time.
        cause: Cause,
    },
    /// A node's health has changed.
    Health {
        /// Which.
        node: NodeId,
        /// To what.
        health: Health,
    },
    /// A node answers in another mode than before; its set-point is dropped.
    ModeChanged {
        /// Which.
        node: NodeId,
        /// The new mode.
        mode: Mode,
    },
    /// A node has answered a READ that followed the WRITE to be confirmed.
    Confirmed {
        /// Which.
        node: NodeId,
    },
    /// The READ that was to confirm a WRITE failed.
    NotConfirmed {
        /// Which node.
        node: NodeId,
        /// What was heard instead.
        cause: Cause,
    },
}

/// Why a window closed without its answer.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause {
    /// Nothing was heard.
    Silent,
    /// Bytes were heard, but no packet: damaged, or noise.
    Damaged,
    /// Only other nodes were heard, or the node in another mode.
    Unexpected,
}

/// Why a command is refused.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CommandError {
    /// The node has not been discovered, or is abnormal.
    NotOnline {
        /// Which.
        node: NodeId,
    },
    /// The node is in the other mode (ruling I3).
    WrongMode {
        /// Which.
        node: NodeId,
        /// The mode it is in.
        mode: Mode,
    },
    /// The node has not told a position yet that could be held (ruling I6).
    NoPosition {
        /// Which.
        node: NodeId,
    },
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotOnline { node } => write!(f, "node {node} is not online"),
            Self::WrongMode { node, mode } => write!(f, "node {node} is in {mode} mode"),
            Self::NoPosition { node } => write!(f, "node {node} has not told its position"),
        }
    }
}

impl core::error::Error for CommandError {}

/// What the master has seen of the line as a whole.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MasterStatistics {
    /// WRITE packets sent.
    pub writes: u32,
    /// READ packets sent.
    pub reads: u32,
    /// Bytes dropped because they stood on the line before a request, bytes.
    pub stale_bytes: u32,
    /// Own bytes heard again and removed, bytes.
    pub echo_bytes: u32,
    /// Times that the echo was not what had been sent.
    pub echo_errors: u32,
    /// Events refused because nobody took the older ones.
    pub lost_events: u32,
}

impl<B: Board> Master<B> {
    /// A master that knows no nodes yet: [`discover`](Self::discover) them.
    #[must_use]
    pub fn new(config: MasterConfig) -> Self {
        Self {
            config,
            nodes: [const { Node::NEW }; 8],
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

/// Why it is sent.
#[derive(Clone, Copy, Debug)]
enum Source {
    Fresh,
    Discovery,
    Probe,
    Poll,
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

/// Choosing and sending requests.
impl<B: Board> Master<B> {
    /// When the next request is due, wherever the line may be.
    fn due(&self) -> Option<Instant> {
        let at = |due| match due {
            Due::Never => None,
            Due::Now => Some(self.now),
            Due::At(at) => Some(at),
        };
        let fresh = self.nodes.iter().filter_map(|node| at(node.fresh_due())).min();
        let discovery = self.discovery.map(|discovery| {
            let guard = self.nodes[discovery.next & 7].guarded_until;
            guard.map_or(self.now, |until| until.max(self.now))
        });
        let polled = match self.discovery {
            Some(_) => None,
            None => self.nodes.iter().filter_map(|node| at(node.due(&self.config))).min(),
        };
        [fresh, discovery, polled, at(self.probe_due())].into_iter().flatten().min()
    }

    /// When an abnormal node may be looked for.
    fn probe_due(&self) -> Due {
        let wanted = self.config.recovery_share_pct > 0 && self.discovery.is_none();
        if !wanted {
            return Due::Never;
        }
        // Nor before a late answer of the node can be told from the one that is asked for.
        let guards = self.nodes.iter().filter(|node| node.is_abnormal());
        let guard = guards.map(|node| node.guarded_until.unwrap_or(self.now)).min();
        match (guard, self.probe_at) {
            (None, _) => Due::Never,
            (Some(guard), None) => Due::At(guard),
            (Some(guard), Some(probe)) => Due::At(guard.max(probe)),
        }
    }

    /// What to send now, if anything.
    ///
    /// New set-points go first, so that a stop never waits for a discovery; but a node whose
    /// set-point has just jumped the queue waits for an exchange before the next one may, so that
    /// no flood of set-points keeps the others from being read.
    fn next_request(&mut self, now: Instant) -> Option<(NodeId, Request)> {
        let is_free = self.line_free.is_none_or(|free| now >= free);
        if !is_free && !self.is_behind_write {
            return None;
        }
        let fresh = |jumped| {
            let wanted =
                move |node: &Node<B>| node.fresh_due().is_reached(now) && node.jumped == jumped;
            let index = self.nodes.iter().position(wanted)?;
            Some((index, Request::Write, Source::Fresh))
        };
        let chosen = fresh(false).or_else(|| self.next_exchange(now)).or_else(|| fresh(true));
        let (index, request, source) = chosen?;
        if !is_free && request == Request::Write {
            return None; // only a READ may follow on the heels of a WRITE
        }
        match source {
            Source::Fresh => self.nodes[index & 7].jumped = true,
            Source::Discovery => {}
            Source::Probe => {
                let share = u32::from(self.config.recovery_share_pct.clamp(1, 50));
                let pause = self.window().saturating_mul(100).as_micros() / share;
                (self.probe_turn, self.probe_at) =
                    (index, Some(now + Duration::from_micros(pause)));
            }
            // Behind its WRITE the node is still to be read.
            Source::Poll if request == Request::Write && !B::ANSWERS_WRITE => self.turn = index,
            Source::Poll => self.turn = (index + 1) & 7,
        }
        Some((NodeId::ALL[index & 7], request))
    }

    /// The next request that is no new set-point: of a discovery, of the search for abnormal
    /// nodes, or of the node whose turn it is.
    fn next_exchange(&self, now: Instant) -> Option<(usize, Request, Source)> {
        let from = |first: usize| (0..8).map(move |step| (first + step) & 7);
        if let Some(discovery) = self.discovery {
            let guard = self.nodes[discovery.next & 7].guarded_until;
            let is_open = guard.is_none_or(|until| now >= until);
            return is_open.then_some((discovery.next, Request::Read, Source::Discovery));
        }
        if self.probe_due().is_reached(now) {
            let is_open = |node: &Node<B>| node.guarded_until.is_none_or(|until| now >= until);
            let is_sought = |node: &Node<B>| node.is_abnormal() && is_open(node);
            let index = from(self.probe_turn + 1).find(|&index| is_sought(&self.nodes[index]))?;
            return Some((index, Request::Read, Source::Probe));
        }
        let is_due = |index: &usize| self.nodes[*index].due(&self.config).is_reached(now);
        let index = from(self.turn).find(is_due)?;
        let node = &self.nodes[index];
        let is_write = node.target.is_some() && !node.written;
        let request = if is_write { Request::Write } else { Request::Read };
        Some((index, request, Source::Poll))
    }

    /// Puts the request into the buffer that is handed out.
    fn encode(&mut self, id: NodeId, request: Request) -> Option<()> {
        let mut buffer = [0; PACKET_LEN];
        let bytes = match (request, self.node(id).target) {
            (Request::Read, _) => ReadRequest::new(id).encode(&mut buffer),
            (Request::Write, None) => return None,
            (Request::Write, Some(Target::Velocity(to))) => {
                B::write_velocity(id, to).encode(&mut buffer)
            }
            (Request::Write, Some(Target::Position(to))) => {
                B::write_position(id, to).encode(&mut buffer)
            }
        };
        self.packet.clear();
        self.packet.extend_from_slice(bytes.ok()?).ok()?;
        if request == Request::Write {
            self.node_mut(id).sent_target();
        }
        Some(())
    }

    /// Remembers what an echoing line will give back.
    fn expect_echo(&mut self) {
        if self.config.removes_echo {
            // Where the line gives back nothing, old expectations are of no use.
            if self.echo.len() + self.packet.len() > ECHO_LEN {
                self.echo.clear();
            }
            for &byte in &self.packet {
                let _ = self.echo.push_back(byte);
            }
        }
    }
}

/// Windows and what is heard in them.
impl<B: Board> Master<B> {
    /// From handing out a READ to the end of its window.
    fn window(&self) -> Duration {
        self.answer_time(wire_time(ReadRequest::LEN, self.config.baud))
    }

    /// `request` and the time that its answer may take.
    fn answer_time(&self, request: Duration) -> Duration {
        let answer = wire_time(<B::ToMaster as Framing>::MAX_LEN, self.config.baud);
        request + self.config.reply_timeout + answer
    }

    /// Opens the window of a request, and drops what was left on the line before it (I7).
    fn open(&mut self, node: NodeId, request_end: Instant) {
        let stale = self.decoder.pending();
        self.statistics.stale_bytes = self.statistics.stale_bytes.wrapping_add(stale as u32);
        while self.decoder.pending() > 0 {
            self.decoder.idle();
            while self.decoder.decode(&mut [].as_slice()).is_some() {}
        }
        let is_scan = self.discovery.is_some();
        for node in &mut self.nodes {
            node.jumped = false;
        }
        let (config, now) = (self.config, self.now);
        let asked = self.node_mut(node);
        asked.sent_read(&config, now);
        asked.scans = asked.scans.saturating_add(is_scan.into());
        let deadline = request_end + self.answer_time(Duration::ZERO);
        self.state = State::Awaiting { node, request_end, deadline, heard: Heard::Nothing };
    }

    /// The next whole response in the input.
    fn next_response(&mut self, bytes: &mut &[u8]) -> Option<(NodeId, Status<B>)> {
        loop {
            match self.decoder.decode(bytes)? {
                Event::Frame(frame) => return Some(B::response(frame)),
                Event::Skipped(_) => {}
            }
        }
    }

    /// A node has spoken. Whether that is an answer is decided here and nowhere else.
    fn hear(&mut self, id: NodeId, status: Status<B>, now: Instant) {
        match &mut self.state {
            State::Awaiting { node, deadline, request_end, .. }
                if *node == id && now <= *deadline =>
            {
                let request_end = *request_end;
                self.state = State::Idle;
                self.line_free = Some(now + self.config.turnaround_gap);
                if self.is_believed(id, status.mode()) {
                    self.accept(id, status, request_end, now);
                }
                self.settle_discovery();
            }
            state => {
                if let State::Awaiting { heard, .. } = state {
                    *heard = Heard::Others;
                }
                let late = &mut self.node_mut(id).statistics.late;
                *late = late.wrapping_add(1);
            }
        }
    }

    /// An answer in another mode than the node's is believed the second time in a row.
    fn is_believed(&mut self, id: NodeId, mode: Mode) -> bool {
        let node = self.node_mut(id);
        let is_other = node.mode.is_some_and(|known| known != mode);
        if is_other && !node.other_mode {
            node.other_mode = true;
            node.asked = true;
            node.statistics.other_mode = node.statistics.other_mode.wrapping_add(1);
            return false;
        }
        node.other_mode = false;
        true
    }

    /// Takes an answer.
    fn accept(&mut self, id: NodeId, status: Status<B>, request_end: Instant, now: Instant) {
        let answer = wire_time(<B::ToMaster as Framing>::MAX_LEN, self.config.baud);
        let latency = now - (request_end + answer);
        let mode = status.mode();
        let node = self.node_mut(id);
        let (was, was_mode) = (node.health, node.mode);
        node.statistics.reply(latency);
        (node.health, node.mode, node.status) =
            (Some(Health::Online), Some(mode), Some((status, now)));
        (node.strikes, node.attempt, node.guarded_until) = (0, 0, None);
        let is_confirmed = node.confirm == Confirm::AfterRead;
        if is_confirmed {
            node.confirm = Confirm::Unasked;
        }
        let is_changed = was_mode.is_some_and(|was| was != mode);
        if is_changed {
            node.forget_target();
        }
        match was {
            None => self.tell(MasterEvent::Discovered { node: id, mode }),
            Some(Health::Online) => {}
            Some(_) => self.tell(MasterEvent::Health { node: id, health: Health::Online }),
        }
        if is_changed {
            self.tell(MasterEvent::ModeChanged { node: id, mode });
        }
        self.tell(MasterEvent::Status { node: id, status });
        if is_confirmed {
            self.tell(MasterEvent::Confirmed { node: id });
        }
    }

    /// A window has closed without its answer.
    fn strike(&mut self, id: NodeId, cause: Cause, deadline: Instant) {
        let (attempts, guard) = (self.config.attempts.max(1), self.config.late_guard);
        let node = self.node_mut(id);
        node.guarded_until = Some(deadline + guard);
        node.statistics.timeouts = node.statistics.timeouts.wrapping_add(1);
        if cause == Cause::Damaged {
            node.statistics.crc_errors = node.statistics.crc_errors.wrapping_add(1);
        }
        if !node.is_online() {
            return; // looked for, and not found
        }
        node.strikes = node.strikes.saturating_add(1);
        node.attempt = node.attempt.saturating_add(1);
        let is_abnormal = node.strikes >= STRIKES;
        let is_failed = is_abnormal || node.attempt >= attempts;
        let health = if is_abnormal { Health::Abnormal } else { Health::Suspect(node.strikes) };
        node.health = Some(health);
        if is_abnormal && !(node.is_stop && node.fresh) {
            node.forget_target();
        }
        let confirm = node.confirm;
        if is_failed {
            node.attempt = 0;
            node.confirm = Confirm::Unasked;
        }
        self.tell(MasterEvent::Health { node: id, health });
        if is_failed {
            self.tell(MasterEvent::ReadFailed { node: id, cause });
            if confirm != Confirm::Unasked {
                self.tell(MasterEvent::NotConfirmed { node: id, cause });
            }
        }
    }

    /// Moves a discovery past the ids that need not be asked, and ends it behind the last.
    fn settle_discovery(&mut self) {
        let Some(mut discovery) = self.discovery else { return };
        while discovery.pass < self.config.attempts.max(1) {
            match self.nodes.get(discovery.next) {
                None => discovery = Discovery { pass: discovery.pass + 1, next: 0 },
                // Asked in this pass, or found.
                Some(node) if node.is_online() || node.scans > discovery.pass => {
                    discovery.next += 1
                }
                Some(_) => {
                    self.discovery = Some(discovery);
                    return;
                }
            }
        }
        self.discovery = None;
        let online = self.nodes.iter().filter(|node| node.is_online()).count();
        self.tell(MasterEvent::DiscoveryDone { online: online as u8 });
    }

    /// The input behind the bytes that are our own.
    fn without_echo<'b>(&mut self, mut bytes: &'b [u8]) -> &'b [u8] {
        while let (Some(own), [first, rest @ ..]) = (self.echo.front(), bytes) {
            if own != first {
                self.statistics.echo_errors = self.statistics.echo_errors.wrapping_add(1);
                self.echo.clear();
                break;
            }
            self.statistics.echo_bytes = self.statistics.echo_bytes.wrapping_add(1);
            self.echo.pop_front();
            bytes = rest;
        }
        bytes
    }
}
