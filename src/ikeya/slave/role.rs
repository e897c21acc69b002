//! The slave: its commands, and the calls of its driver.

use heapless::Vec;

use super::{
    config::SlaveConfig,
    event::SlaveEvent,
    requests::{Found, Requests},
    statistics::SlaveStatistics,
};
use crate::{
    encode::Encode,
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    events::Latest,
    ikeya::{
        board::{Board, Command, OneMotor, PACKET_LEN, Target},
        units::{Mode, NodeId},
    },
    stats::{count, uncount},
    stream::Counters,
    time::{Duration, Instant, earliest, reached, wire_time},
};

/// A slave: follows the traffic of all nodes, answers a READ for its own id with the status that
/// the application has set, and passes on the commands for it (ruling I9).
///
/// ```
/// use axlewire::ikeya::{slave::SlaveConfig, Mode, NodeId, Rps, Slave};
/// use axlewire::ikeya::{ReadRequest, VelocityResponse};
/// use axlewire::{endpoint::Endpoint, time::Instant};
///
/// let now = Instant::from_micros(0);
/// let mut slave = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), now);
/// let current = Rps::new(1.0)?;
/// slave.set_velocity(current);
/// slave.handle_input(ReadRequest::new(NodeId::N2).as_bytes(), now);
/// let answer = VelocityResponse::new(NodeId::N2, current);
/// assert_eq!(slave.poll_transmit(now), Some(&answer.as_bytes()[..]));
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
///
/// * Only [`ThreeMotors`](crate::ikeya::board::ThreeMotors) boards answer a WRITE (I3, I10).
/// * On any error the previous command stays: a damaged packet is ignored, and a NaN or infinite
///   speed is counted and refused (I4).
/// * A request is not answered if another byte follows it or the answer is too late (I14): the
///   master has moved on, and the answer would collide with the next node's.
/// * On two wires it follows the answers of other nodes, so that it finds no request inside them
///   (I14).
#[derive(Clone, Debug)]
pub struct Slave<B: Board = OneMotor> {
    node: NodeId,
    mode: Mode,
    config: SlaveConfig,
    velocity: Option<B::Velocity>,
    position: Option<B::Position>,
    command: Option<Target<B>>,
    commanded_at: Option<Instant>,
    /// The answer to the latest request.
    answer: Option<Answer>,
    /// The answer handed out last, until the port has taken it.
    sent: Option<Answer>,
    /// Whether more has been heard since.
    is_overtaken: bool,
    /// Whether its time has passed, and that of a packet on the line.
    is_late: bool,
    requests: Requests<B>,
    packet: Vec<u8, PACKET_LEN>,
    event: Latest<SlaveEvent<B>>,
    statistics: SlaveStatistics,
}

/// Time span in which an answer may be sent.
#[derive(Clone, Copy, Debug)]
struct Answer {
    from: Instant,
    until: Instant,
}

impl Answer {
    /// The answer to a request that ended in this time. The gap is kept even if it ended last.
    fn new(request_end: Arrival, config: &SlaveConfig) -> Self {
        let gap = config.turnaround_gap;
        let until = request_end.since() + gap + config.answer_within;
        Self { from: request_end.now() + gap, until }
    }
}

impl Slave {
    /// Creates a slave that is not moving and has heard nothing yet. For the usual board; see
    /// [`for_board`](Self::for_board) for the other one.
    #[must_use]
    #[inline] // Otherwise it would be compiled here, apart from the program that uses it.
    pub fn new(node: NodeId, mode: Mode, config: SlaveConfig, now: Instant) -> Self {
        Self::for_board(node, mode, config, now)
    }
}

impl<B: Board> Slave<B> {
    /// Creates a slave with this [`Board`], which is not moving and has heard nothing yet.
    #[must_use]
    pub fn for_board(node: NodeId, mode: Mode, config: SlaveConfig, now: Instant) -> Self {
        let config = config.sane();
        Self {
            node,
            mode,
            config,
            velocity: Some(B::ZERO),
            position: None,
            command: None,
            commanded_at: None,
            answer: None,
            sent: None,
            is_overtaken: false,
            is_late: false,
            requests: Requests::new(config.two_wire, config.idle, now),
            packet: Vec::new(),
            event: Latest::new(),
            statistics: SlaveStatistics::default(),
        }
    }

    /// Sets the speed that a velocity node reports from now on; at first it reports 0. After a
    /// change of mode it does not answer before the next call: a master would take an old speed
    /// for a motor that is still.
    pub fn set_velocity(&mut self, current: B::Velocity) {
        self.velocity = Some(current);
    }

    /// Sets the position that a position node reports from now on. Before the first call, and
    /// before the next one after a change of mode, the node does not answer at all: a master
    /// would hold a made-up or an old position.
    pub fn set_position(&mut self, current: B::Position) {
        self.position = Some(current);
    }

    /// Changes the mode, as when the switch is moved. The command is dropped: it was meant for the
    /// other mode, and its watchdog ends with it: **stop the motor yourself**. The speed and the
    /// position that were set are forgotten: they may be from long ago.
    pub fn set_mode(&mut self, mode: Mode) {
        if mode != self.mode {
            (self.mode, self.command, self.commanded_at) = (mode, None, None);
            (self.velocity, self.position) = (None, None);
            if let Some(SlaveEvent::Command(_)) = self.event.peek() {
                self.event.take();
            }
        }
    }

    /// The id on the wire.
    #[must_use]
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// The mode in which a WRITE is read.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The command in force: the last good one; `None` before the first, and once the watchdog has
    /// fired.
    ///
    /// Correct at any time, whether or not events have been taken out and timeouts handled.
    #[must_use]
    pub fn command(&self, now: Instant) -> Option<Target<B>> {
        if reached(self.watchdog_at(), now) { None } else { self.command }
    }

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &SlaveConfig {
        &self.config
    }

    /// Counts of the slave.
    #[must_use]
    pub const fn statistics(&self) -> &SlaveStatistics {
        &self.statistics
    }

    /// Accounts for every received byte.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.requests.counters()
    }

    /// Number of events lost because the application did not poll in time; saturates at 2^32 - 1.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.event.lost()
    }

    /// Processes received bytes, and the packets that they complete.
    fn receive(&mut self, mut bytes: &[u8], arrived: Arrival) {
        while let Some(found) = self.requests.next(&mut bytes) {
            match found {
                Found::Answer => count(&mut self.statistics.answers),
                Found::Request { request: (node, command), is_last } => {
                    self.hear(node, command, is_last, arrived);
                }
            }
        }
    }

    /// Handles one complete request, for any node.
    fn hear(&mut self, node: NodeId, command: Option<Command<B>>, is_last: bool, at: Arrival) {
        self.overtake();
        if node != self.node {
            return count(&mut self.statistics.foreign);
        }
        match command {
            None => count(&mut self.statistics.reads),
            Some(command) => {
                count(&mut self.statistics.writes);
                self.obey(command, at.since());
            }
        }
        if command.is_none() || B::ANSWERS_WRITE {
            self.answer = Some(Answer::new(at, &self.config));
            if !is_last {
                self.overtake();
            }
        }
    }

    /// Drops the answer: more bytes have been received, and it would collide with them.
    fn overtake(&mut self) {
        if self.answer.take().is_some() {
            count(&mut self.statistics.overtaken);
        }
    }

    /// Obeys a WRITE, read in the node's own mode.
    fn obey(&mut self, command: Command<B>, at: Instant) {
        let target = match self.mode {
            Mode::Velocity => B::finite(command.velocity).map(Target::Velocity),
            Mode::Position => Some(Target::Position(command.position)),
        };
        let Some(target) = target else { return count(&mut self.statistics.refused) };
        (self.command, self.commanded_at) = (Some(target), Some(at));
        self.tell(SlaveEvent::Command(target));
    }

    /// Puts an event; it replaces one that has not been taken.
    fn tell(&mut self, event: SlaveEvent<B>) {
        self.event.put(event);
    }

    fn watchdog_at(&self) -> Option<Instant> {
        Some(self.commanded_at? + self.config.watchdog?)
    }

    fn expire_command(&mut self, now: Instant) {
        if reached(self.watchdog_at(), now) {
            (self.command, self.commanded_at) = (None, None);
            count(&mut self.statistics.watchdog);
            self.tell(SlaveEvent::Watchdog);
        }
    }
}

impl<B: Board> Endpoint for Slave<B> {
    type Event = SlaveEvent<B>;

    /// Treats commands and requests as old as they can be.
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let (since, now) = (arrived.since(), arrived.now());
        if !bytes.is_empty() {
            self.is_overtaken = true;
            self.overtake();
            self.requests.receive(since, now);
            self.receive(bytes, arrived);
        } else if let Some(answer) = self.sent {
            // Once it has begun, it may end.
            self.is_late |= now > answer.until + wire_time(PACKET_LEN, self.config.baud);
        }
        // A command may be too old already.
        self.expire_command(now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        if self.requests.settle(now) {
            self.receive(&[], Arrival::Between { since: self.requests.last(), now });
        }
        self.expire_command(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let answer = self.answer.filter(|answer| now >= answer.from)?;
        self.answer = None;
        if now > answer.until {
            count(&mut self.statistics.expired);
            return None;
        }
        let mut buffer = [0; PACKET_LEN];
        let packet = match self.mode {
            Mode::Velocity => B::velocity_response(self.node, self.velocity?).encode(&mut buffer),
            Mode::Position => B::position_response(self.node, self.position?).encode(&mut buffer),
        };
        self.packet.clear();
        self.packet.extend_from_slice(packet.ok()?).ok()?;
        count(&mut self.statistics.replies);
        (self.sent, self.is_overtaken, self.is_late) = (Some(answer), false, false);
        Some(&self.packet)
    }

    /// Whether more has been heard since the answer was handed out, or its time has passed (I14).
    fn is_outdated(&self) -> bool {
        self.is_overtaken || self.is_late
    }

    /// An answer of which no byte has left remains due, within its time. One that was cut off is
    /// not repeated: the master asks again.
    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, _: Instant) {
        let outcome = outcome.into();
        if outcome == Transmit::Flushed {
            return;
        }
        let Some(answer) = self.sent.take() else { return };
        if outcome == Transmit::Unsent(Unsent::Untouched) {
            uncount(&mut self.statistics.replies);
            match self.is_overtaken {
                true => count(&mut self.statistics.overtaken),
                false => self.answer = Some(answer),
            }
        }
    }

    /// Old are bytes that may have waited for longer than [`SlaveConfig::answer_within`], but at
    /// least 4 ms, for timers of 1 ms, and at most 20 ms.
    fn line_rules(&self) -> LineRules {
        const SHORTEST: Duration = Duration::from_millis(4);
        let limit = self.config.answer_within.clamp(SHORTEST, Duration::from_millis(20));
        LineRules {
            frame_pause: self.config.idle,
            baud: self.config.baud,
            held_up_after: Some(limit),
        }
    }

    fn poll_event(&mut self) -> Option<SlaveEvent<B>> {
        self.event.take()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let answer_at = self.answer.map(|answer| answer.from);
        earliest(&[answer_at, self.requests.deadline(), self.watchdog_at()])
    }
}
