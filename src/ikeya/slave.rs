//! A slave of a motor bus: hears all, answers only what it is asked, keeps the last good command.

use heapless::Vec;

use super::{BAUD, Board, DipSwitch, IdReading, Mode, NodeId, OneMotor, ReadRequest, Target};
use crate::{
    endpoint::Endpoint,
    error::EncodeError,
    stream::{Counters, Decoder, Encode, Event, Framing},
    time::{Duration, Instant, wire_time},
};

/// Longest packet of either kind of board, bytes.
const PACKET_LEN: usize = 16;

/// Settings of a [`Slave`]: start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct SlaveConfig {
    /// How long to go on without a command before [`SlaveEvent::Watchdog`]. The protocol document has
    /// no such time, hence `None`: a motor then keeps its last command for ever.
    pub watchdog: Option<Duration>,
    /// Silence kept between a request and its answer, for transceivers that need it. Together with
    /// the processor's own time it should stay below 50 µs (ruling I9).
    pub turnaround_gap: Duration,
    /// Silence after which the start of a packet is given up (ruling B3). Longer than the longest
    /// pause that the port makes inside a packet.
    pub idle: Duration,
}

impl SlaveConfig {
    /// For a UART of the processor itself at 500 kbit/s: a pause of five bytes ends a packet.
    #[must_use]
    pub const fn direct() -> Self {
        Self::at(BAUD)
    }

    /// For a UART of the processor itself at another speed, bit/s.
    #[must_use]
    pub const fn at(baud: u32) -> Self {
        Self { watchdog: None, turnaround_gap: Duration::ZERO, idle: wire_time(5, baud) }
    }

    /// For a slave on a host: a USB adapter makes pauses of up to 16 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self { idle: Duration::from_millis(20), ..Self::direct() }
    }
}

/// [`direct`](SlaveConfig::direct).
impl Default for SlaveConfig {
    fn default() -> Self {
        Self::direct()
    }
}

/// A slave: follows the traffic of all nodes, answers a READ for its own id with the status that the
/// application has set, and hands on the commands for it (ruling I9).
///
/// * A WRITE is answered only by [`ThreeMotors`](super::ThreeMotors) boards (I3, I10).
/// * On any error the previous command stays: a damaged packet is no packet, and a speed that is no
///   number is counted and refused (I4).
/// * A request that is followed by another packet is not answered any more: its master has moved
///   on, and an answer would meet the next node's.
///
/// ```
/// use axlewire::{
///     endpoint::Endpoint,
///     ikeya::{Mode, NodeId, ReadRequest, Rps, Slave, SlaveConfig, VelocityResponse},
///     time::Instant,
/// };
///
/// let mut slave: Slave = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct());
/// let current = Rps::new(1.0)?;
/// slave.set_velocity(current);
/// let now = Instant::from_micros(0);
/// slave.handle_input(ReadRequest::new(NodeId::N2).as_bytes(), now);
/// let answer = VelocityResponse::new(NodeId::N2, current);
/// assert_eq!(slave.poll_transmit(now), Some(&answer.as_bytes()[..]));
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Slave<B: Board = OneMotor> {
    node: NodeId,
    mode: Mode,
    config: SlaveConfig,
    velocity: B::Velocity,
    position: Option<B::Position>,
    command: Option<Target<B>>,
    commanded_at: Option<Instant>,
    /// When the answer to the request that was heard last may be sent.
    answer_at: Option<Instant>,
    heard_at: Option<Instant>,
    /// How many of the received bytes the decoder has reported, in packets and gaps.
    reported: u64,
    decoder: Decoder<B::ToSlave, PACKET_LEN>,
    packet: Vec<u8, PACKET_LEN>,
    event: Option<SlaveEvent<B>>,
    statistics: SlaveStatistics,
}

/// What the slave tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SlaveEvent<B: Board = OneMotor> {
    /// A command for this node, in its mode. Repeated as often as the master repeats it.
    Command(Target<B>),
    /// No command for [`SlaveConfig::watchdog`]: stop what moves.
    Watchdog,
}

/// What a slave has heard. All counts wrap.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct SlaveStatistics {
    /// READ packets for this node.
    pub reads: u32,
    /// WRITE packets for this node.
    pub writes: u32,
    /// Of these, refused because the speed was no number (ruling I4).
    pub refused: u32,
    /// Packets for other nodes.
    pub foreign: u32,
    /// Answers sent.
    pub replies: u32,
    /// Requests not answered, because another packet followed at once.
    pub overtaken: u32,
    /// Events that nobody had taken when the next one replaced them.
    pub lost_events: u32,
}

impl<B: Board> Slave<B> {
    /// A slave that stands still and has heard nothing yet.
    #[must_use]
    pub fn new(node: NodeId, mode: Mode, config: SlaveConfig) -> Self {
        Self {
            node,
            mode,
            config,
            velocity: B::ZERO,
            position: None,
            command: None,
            commanded_at: None,
            answer_at: None,
            heard_at: None,
            reported: 0,
            decoder: Decoder::new(),
            packet: Vec::new(),
            event: None,
            statistics: SlaveStatistics::default(),
        }
    }

    /// A slave with the id and mode of a DIP switch, in the reading that the board's maker meant
    /// (ruling I2).
    ///
    /// # Errors
    ///
    /// [`EncodeError::DipSwitch`] where that reading gives no id.
    pub fn from_dip(
        dip: DipSwitch,
        reading: IdReading,
        config: SlaveConfig,
    ) -> Result<Self, EncodeError> {
        Ok(Self::new(dip.node_id(reading)?, dip.mode(), config))
    }

    /// The speed that a velocity node answers with from now on.
    pub fn set_velocity(&mut self, current: B::Velocity) {
        self.velocity = current;
    }

    /// The position that a position node answers with from now on. Before the first one it does not
    /// answer at all: a master would take a made-up position for one to hold.
    pub fn set_position(&mut self, current: B::Position) {
        self.position = Some(current);
    }

    /// Changes the mode, as when somebody moves the switch. The command is forgotten: it was meant
    /// for the other mode.
    pub fn set_mode(&mut self, mode: Mode) {
        if mode != self.mode {
            (self.mode, self.command, self.commanded_at) = (mode, None, None);
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

    /// The last good command; `None` before the first, and after the watchdog.
    #[must_use]
    pub const fn command(&self) -> Option<Target<B>> {
        self.command
    }

    /// The counts.
    #[must_use]
    pub const fn statistics(&self) -> &SlaveStatistics {
        &self.statistics
    }

    /// Where every byte went.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.decoder.counters()
    }

    /// Takes in bytes and what they complete.
    ///
    /// A READ whose bytes had all been received before, and that new ones have freed from behind a
    /// false header, is overtaken by them. (A WRITE is never held back whole: it is as long as any
    /// false header can promise.)
    fn take(&mut self, mut bytes: &[u8], now: Instant) {
        let (before, is_input) = (self.decoder.received(), !bytes.is_empty());
        while let Some((node, command)) = self.next_request(&mut bytes) {
            self.hear(node, command, now);
            let is_old = is_input && self.reported <= before;
            if is_old && self.answer_at.take().is_some() {
                count(&mut self.statistics.overtaken);
            }
        }
    }

    /// Takes one whole packet, whoever it is for.
    fn hear(&mut self, node: NodeId, command: Option<super::Command<B>>, now: Instant) {
        if self.answer_at.take().is_some() {
            count(&mut self.statistics.overtaken);
        }
        if node != self.node {
            return count(&mut self.statistics.foreign);
        }
        match command {
            None => count(&mut self.statistics.reads),
            Some(command) => {
                count(&mut self.statistics.writes);
                self.obey(command, now);
            }
        }
        if command.is_none() || B::ANSWERS_WRITE {
            self.answer_at = Some(now + self.config.turnaround_gap);
        }
    }

    /// Reads a WRITE in the node's own mode.
    fn obey(&mut self, command: super::Command<B>, now: Instant) {
        let target = match self.mode {
            Mode::Velocity => B::finite(command.velocity).map(Target::Velocity),
            Mode::Position => Some(Target::Position(command.position)),
        };
        let Some(target) = target else { return count(&mut self.statistics.refused) };
        (self.command, self.commanded_at) = (Some(target), Some(now));
        self.tell(SlaveEvent::Command(target));
    }

    /// The latest event counts: it replaces one that nobody has taken.
    fn tell(&mut self, event: SlaveEvent<B>) {
        if self.event.replace(event).is_some() {
            count(&mut self.statistics.lost_events);
        }
    }

    /// The next whole request in the input.
    fn next_request(&mut self, bytes: &mut &[u8]) -> Option<(NodeId, Option<super::Command<B>>)> {
        loop {
            match self.decoder.decode(bytes)? {
                Event::Frame(frame) => {
                    let (node, command) = B::request(frame);
                    let len =
                        if command.is_some() { B::ToSlave::MAX_LEN } else { ReadRequest::LEN };
                    self.reported = self.reported.wrapping_add(len as u64);
                    return Some((node, command));
                }
                Event::Skipped(gap) => self.reported = self.reported.wrapping_add(gap.len),
            }
        }
    }

    fn watchdog_at(&self) -> Option<Instant> {
        Some(self.commanded_at? + self.config.watchdog?)
    }

    /// When the start of a packet that is pending is given up.
    fn idle_at(&self) -> Option<Instant> {
        let pending = self.decoder.pending() > 0;
        self.heard_at.filter(|_| pending).map(|heard| heard + self.config.idle)
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

impl<B: Board> Endpoint for Slave<B> {
    type Event = SlaveEvent<B>;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        if !bytes.is_empty() {
            self.heard_at = Some(now);
            self.take(bytes, now);
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        if self.idle_at().is_some_and(|at| now >= at) {
            self.decoder.idle();
            self.take(&[], now);
            // What is left may be the start of a packet again, with the same patience.
            self.heard_at = Some(now);
        }
        if self.watchdog_at().is_some_and(|at| now >= at) {
            (self.command, self.commanded_at) = (None, None);
            self.tell(SlaveEvent::Watchdog);
        }
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        if self.answer_at.is_none_or(|at| now < at) {
            return None;
        }
        self.answer_at = None;
        let mut buffer = [0; PACKET_LEN];
        let packet = match (self.mode, self.position) {
            (Mode::Velocity, _) => {
                B::velocity_response(self.node, self.velocity).encode(&mut buffer)
            }
            (Mode::Position, Some(at)) => B::position_response(self.node, at).encode(&mut buffer),
            (Mode::Position, None) => return None,
        };
        self.packet.clear();
        self.packet.extend_from_slice(packet.ok()?).ok()?;
        count(&mut self.statistics.replies);
        Some(&self.packet)
    }

    fn poll_event(&mut self) -> Option<SlaveEvent<B>> {
        self.event.take()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        [self.answer_at, self.idle_at(), self.watchdog_at()].into_iter().flatten().min()
    }
}
