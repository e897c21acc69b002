//! Two wire pairs, one head, any number of tails, and virtual time.

use alloc::vec::Vec;
use core::{error::Error, fmt, mem};

use super::{
    faults::{Faults, PairStatistics},
    port::{Port, Timing, Trouble, WireByte, earlier},
    rng::Rng,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant},
};

/// A station on the line.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Who {
    /// The station at the head: a master, a host.
    Head,
    /// A station at the tail, numbered in the order in which they were added: a slave, a robot.
    Tail(usize),
}

/// One of the two wire pairs.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Direction {
    /// From the head to every tail.
    ToTails,
    /// From the tails to the head.
    ToHead,
}

/// A byte on the line.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Traced {
    /// When it was complete.
    pub at: Instant,
    /// Its sender.
    pub who: Who,
    /// The byte, after the faults of the sender's stub and the pair.
    pub byte: u8,
}

/// An endpoint breaks the contract: virtual time cannot go on.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Stuck {
    /// It asks to be called again at once, forever, but then does nothing.
    BusyLoop {
        /// The endpoint.
        who: Who,
        /// The time.
        at: Instant,
    },
    /// It sends, or reports events, without end at one instant.
    Endless {
        /// The endpoint.
        who: Who,
        /// The time.
        at: Instant,
    },
}

impl fmt::Display for Stuck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (who, at, what) = match self {
            Self::BusyLoop { who, at } => (who, at, "its poll_timeout stays in the past"),
            Self::Endless { who, at } => (who, at, "it sends or tells events without end"),
        };
        match who {
            Who::Head => f.write_str("the head")?,
            Who::Tail(index) => write!(f, "tail {index}")?,
        }
        write!(f, " makes its driver spin at {} µs: {what}", at.as_micros())
    }
}

impl Error for Stuck {}

/// A full-duplex line in virtual time: every tail hears the head, and the head hears the tails. A
/// motor bus is a master with its slaves; a link has a single tail.
///
/// Every endpoint is driven exactly as [`Endpoint`] describes, in an order that depends only on the
/// seed: bytes first, then the head, then the tails in their order.
///
/// * A byte takes 10 bit times (ruling B6). A sender's bytes follow one another, however many it
///   sends at once. Bytes of two senders that overlap on one pair are both garbled.
/// * Set faults on a pair, for all its stations, with [`pair_mut`](Self::pair_mut), or on the stub
///   of one station, for the bytes that it sends and hears, with [`stub_mut`](Self::stub_mut).
///   Bytes from a delayed stub reach the pair later, so that an answer can be late; all other
///   delays are on the way from the pair to the receiver.
/// * [`Timing`] sets how late, and in which pieces, an endpoint's loop sees its input.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::ikeya::{master::{MasterConfig, MasterEvent}, Master, Mode, NodeId, Rps};
/// use axlewire::sim::{Line, MotorNode, Who};
/// use axlewire::time::{Duration, Instant};
///
/// let start = Instant::from_micros(0);
/// let mut master = Master::new(MasterConfig::direct(), start);
/// master.discover(start);
/// let mut line = Line::new(500_000, 1, master);
/// line.add(MotorNode::new(NodeId::N3, Mode::Velocity));
///
/// line.run_for(Duration::from_millis(50))?;
/// assert_eq!(line.head().mode(NodeId::N3), Some(Mode::Velocity));
///
/// let now = line.now();
/// line.head_mut().set_velocity(NodeId::N3, Rps::new(2.0)?, now)?;
/// line.run_for(Duration::from_millis(500))?;
/// assert!((line.tail(0).motor().velocity().get() - 2.0).abs() < 0.01);
///
/// line.stub_mut(Who::Tail(0)).unplugged = true;
/// line.take_head_events();
/// line.run_for(Duration::from_millis(50))?;
/// let is_failure = |event: &MasterEvent| matches!(event, MasterEvent::ReadFailed { .. });
/// assert!(line.take_head_events().iter().any(|(_, event)| is_failure(event)));
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Line<H: Endpoint, T: Endpoint> {
    head: H,
    tails: Vec<T>,
    /// Port of the head, then those of the tails.
    ports: Vec<Port>,
    to_tails: Pair,
    to_head: Pair,
    baud: u32,
    rng: Rng,
    now: Instant,
    head_events: Vec<(Instant, H::Event)>,
    tail_events: Vec<(Instant, usize, T::Event)>,
    trace: Option<Vec<Traced>>,
}

#[derive(Debug, Default)]
struct Pair {
    faults: Faults,
    statistics: PairStatistics,
    /// End of the last byte.
    busy_until: Option<Instant>,
}

const fn port_of(who: Who) -> usize {
    match who {
        Who::Head => 0,
        Who::Tail(index) => index + 1,
    }
}

const fn who_at(port: usize) -> Who {
    match port {
        0 => Who::Head,
        port => Who::Tail(port - 1),
    }
}

/// Stations and their settings.
impl<H: Endpoint, T: Endpoint> Line<H, T> {
    /// A clean line of this speed, bit/s, without tails yet. All randomness comes from `seed`. A
    /// `baud` of 0 counts as 1.
    #[must_use]
    pub fn new(baud: u32, seed: u64, head: H) -> Self {
        let now = Instant::from_micros(0);
        Self {
            head,
            tails: Vec::new(),
            ports: Vec::from([Port::new(now)]),
            to_tails: Pair::default(),
            to_head: Pair::default(),
            baud: baud.max(1),
            rng: Rng::new(seed),
            now,
            head_events: Vec::new(),
            tail_events: Vec::new(),
            trace: None,
        }
    }

    /// The same line, with its time starting at `now` instead of 0, for example just before the
    /// clock wraps. Call it before anything else.
    #[must_use]
    pub fn starting_at(mut self, now: Instant) -> Self {
        self.now = now;
        self.ports = Vec::from([Port::new(now)]);
        self.ports.extend(self.tails.iter().map(|_| Port::new(now)));
        self
    }

    /// Adds another endpoint at the tail; returns its number.
    pub fn add(&mut self, tail: T) -> usize {
        self.tails.push(tail);
        self.ports.push(Port::new(self.now));
        self.tails.len() - 1
    }

    /// The endpoint at the head.
    #[must_use]
    pub const fn head(&self) -> &H {
        &self.head
    }

    /// The endpoint at the head, to give it commands. Its loop then runs once more.
    pub fn head_mut(&mut self) -> &mut H {
        self.ports[0].touch(self.now);
        &mut self.head
    }

    /// The endpoints at the tail.
    #[must_use]
    pub fn tails(&self) -> &[T] {
        &self.tails
    }

    /// An endpoint at the tail.
    ///
    /// # Panics
    ///
    /// If there is no tail of this number.
    #[must_use]
    pub fn tail(&self, index: usize) -> &T {
        &self.tails[index]
    }

    /// An endpoint at the tail, to give it commands. Its loop then runs once more.
    ///
    /// # Panics
    ///
    /// If there is no tail of this number.
    pub fn tail_mut(&mut self, index: usize) -> &mut T {
        self.ports[index + 1].touch(self.now);
        &mut self.tails[index]
    }

    /// Faults of a pair. Change them at any time.
    pub const fn pair_mut(&mut self, direction: Direction) -> &mut Faults {
        match direction {
            Direction::ToTails => &mut self.to_tails.faults,
            Direction::ToHead => &mut self.to_head.faults,
        }
    }

    /// Faults of the wires between one station and the pairs. Change them at any time.
    ///
    /// # Panics
    ///
    /// If there is no such tail.
    pub fn stub_mut(&mut self, who: Who) -> &mut Faults {
        &mut self.ports[port_of(who)].stub
    }

    /// Timing of a station's loop. Change it at any time.
    ///
    /// # Panics
    ///
    /// If there is no such tail.
    pub fn timing_mut(&mut self, who: Who) -> &mut Timing {
        &mut self.ports[port_of(who)].timing
    }
}

/// Time.
impl<H: Endpoint, T: Endpoint> Line<H, T> {
    /// The time.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// When the next event is due; `None` if there never is one.
    #[must_use]
    pub fn next(&self) -> Option<Instant> {
        let mut next = None;
        for port in &self.ports {
            next = earlier(next, earlier(port.sent_at(), port.wakes_at()));
        }
        next.map(|at| at.max(self.now))
    }

    /// Advances to the next instant at which something is due, and runs it; returns that instant.
    /// `None` if nothing is ever due.
    ///
    /// # Errors
    ///
    /// [`Stuck`]: an endpoint breaks the contract.
    pub fn step(&mut self) -> Result<Option<Instant>, Stuck> {
        let next = self.next();
        if let Some(at) = next {
            self.happen(at)?;
        }
        Ok(next)
    }

    /// Runs everything that is due at `now`.
    fn happen(&mut self, now: Instant) -> Result<(), Stuck> {
        self.now = now;
        for port in 0..self.ports.len() {
            while self.ports[port].sent_at().is_some_and(|end| end <= now) {
                if let Some(byte) = self.ports[port].sending.pop_front() {
                    self.carry(port, byte);
                }
            }
        }
        for port in 0..self.ports.len() {
            if self.ports[port].wakes_at().is_some_and(|at| at <= now) {
                self.run_port(port)?;
            }
        }
        Ok(())
    }

    /// Advances by `span`, and runs everything that is due by then.
    ///
    /// # Errors
    ///
    /// [`Stuck`]: an endpoint breaks the contract.
    pub fn run_for(&mut self, span: Duration) -> Result<(), Stuck> {
        let end = self.now + span;
        while let Some(at) = self.next().filter(|at| *at <= end) {
            self.happen(at)?;
        }
        self.now = end;
        Ok(())
    }

    fn run_port(&mut self, port: usize) -> Result<(), Stuck> {
        let (at, mut sent) = (self.now, Vec::new());
        let round = match who_at(port) {
            Who::Head => {
                let tell = |event| self.head_events.push((at, event));
                self.ports[port].run(&mut self.head, at, &mut sent, tell)
            }
            Who::Tail(index) => {
                let tell = |event| self.tail_events.push((at, index, event));
                self.ports[port].run(&mut self.tails[index], at, &mut sent, tell)
            }
        };
        for bytes in &sent {
            self.send(port, bytes);
        }
        let who = who_at(port);
        round.map_err(|trouble| match trouble {
            Trouble::BusyLoop => Stuck::BusyLoop { who, at },
            Trouble::Endless => Stuck::Endless { who, at },
        })
    }
}

/// Bytes on the wires.
impl<H: Endpoint, T: Endpoint> Line<H, T> {
    /// Sends `bytes` from a station without involving its endpoint, after the bytes that it is
    /// sending.
    ///
    /// # Panics
    ///
    /// If there is no such tail.
    pub fn inject(&mut self, who: Who, bytes: &[u8]) {
        self.send(port_of(who), bytes);
    }

    fn send(&mut self, port: usize, bytes: &[u8]) {
        let held_up = self.ports[port].stub.hold_up(&mut self.rng);
        let older = self.ports[port].send(bytes, self.now + held_up, self.baud);
        if port != 0 && !self.ports[port].stub.unplugged {
            self.collide(port, older);
        }
    }

    /// Marks collisions: the bytes from `older` on that overlap another tail's, and those others.
    fn collide(&mut self, port: usize, older: usize) {
        let (before, rest) = self.ports.split_at_mut(port);
        let Some((own, behind)) = rest.split_first_mut() else { return };
        let others = before.iter_mut().skip(1).chain(behind).filter(|port| !port.stub.unplugged);
        for other in others.flat_map(|port| &mut port.sending) {
            for byte in own.sending.iter_mut().skip(older) {
                if byte.start < other.end && other.start < byte.end {
                    (byte.is_collided, other.is_collided) = (true, true);
                }
            }
        }
    }

    /// Carries a byte from a station's transmitter to all stations that hear it.
    fn carry(&mut self, port: usize, sent: WireByte) {
        let (pair, receivers) = match port {
            0 => (&mut self.to_tails, 1..self.ports.len()),
            _ => (&mut self.to_head, 0..1),
        };
        let (rng, stub, faults) = (&mut self.rng, self.ports[port].stub, pair.faults);
        let statistics = &mut pair.statistics;

        let mut on_stub = Vec::new();
        stub.pass(sent.byte, sent.is_first, rng, statistics, &mut on_stub);
        let mut on_pair = Vec::new();
        if !stub.unplugged {
            statistics.bytes += 1;
            statistics.collided += u64::from(sent.is_collided);
            let since = pair.busy_until.map_or(sent.start, |until| until.max(sent.start));
            statistics.busy_us += u64::from((sent.end - since).as_micros());
            pair.busy_until = Some(sent.end);
            for (index, byte) in on_stub.iter().copied().enumerate() {
                // Never 0, which would leave the byte undamaged.
                let garble = if sent.is_collided { 1 + rng.below(255) as u8 } else { 0 };
                let is_first = sent.is_first && index == 0;
                faults.pass(byte ^ garble, is_first, rng, statistics, &mut on_pair);
            }
            if let Some(trace) = &mut self.trace {
                let traced = |byte: &u8| Traced { at: sent.end, who: who_at(port), byte: *byte };
                trace.extend(on_pair.iter().map(traced));
            }
        }
        let echo = match (stub.echo, faults.echo && !stub.unplugged) {
            (_, true) => on_pair.as_slice(),
            (true, false) => on_stub.as_slice(),
            (false, false) => &[],
        };
        for &byte in echo {
            self.ports[port].arrivals.add(byte, sent.end);
        }
        if faults.unplugged {
            return;
        }
        let mut through = Vec::new();
        for receiver in &mut self.ports[receivers] {
            let stub = receiver.stub;
            if stub.unplugged {
                continue;
            }
            through.clear();
            for (index, byte) in on_pair.iter().copied().enumerate() {
                stub.pass(byte, sent.is_first && index == 0, rng, statistics, &mut through);
            }
            for &byte in &through {
                let held_up = faults.hold_up(rng) + stub.hold_up(rng);
                receiver.arrivals.add(byte, sent.end + held_up);
            }
        }
    }
}

/// Events and statistics.
impl<H: Endpoint, T: Endpoint> Line<H, T> {
    /// Takes out the head's events so far, each with the time of its report.
    pub fn take_head_events(&mut self) -> Vec<(Instant, H::Event)> {
        mem::take(&mut self.head_events)
    }

    /// Takes out the tails' events so far: time, number of the tail, and event.
    pub fn take_tail_events(&mut self) -> Vec<(Instant, usize, T::Event)> {
        mem::take(&mut self.tail_events)
    }

    /// Statistics of a pair since the beginning.
    #[must_use]
    pub const fn statistics(&self, direction: Direction) -> &PairStatistics {
        match direction {
            Direction::ToTails => &self.to_tails.statistics,
            Direction::ToHead => &self.to_head.statistics,
        }
    }

    /// Number of rounds of a station's loop since the beginning. Many rounds without a byte or a
    /// deadline are a busy loop, too.
    ///
    /// # Panics
    ///
    /// If there is no such tail.
    #[must_use]
    pub fn polls(&self, who: Who) -> u64 {
        self.ports[port_of(who)].polls
    }

    /// Records every byte on the line from now on.
    pub fn record(&mut self) {
        self.trace.get_or_insert_default();
    }

    /// The recorded bytes, in order of completion; empty without [`record`](Self::record).
    #[must_use]
    pub fn trace(&self) -> &[Traced] {
        self.trace.as_deref().unwrap_or_default()
    }
}
