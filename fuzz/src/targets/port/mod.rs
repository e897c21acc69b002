//! A port, a clock and an executor in virtual time, whose faults the fuzzer chooses. Every call is
//! counted: bounded work is a number of calls, not a time.

mod blocking;
mod executor;
mod waiting;

use std::{
    cell::{RefCell, RefMut},
    collections::VecDeque,
    rc::Rc,
    task::Waker,
};

use arbitrary::Arbitrary;
use axlewire::{drive::Clock, time::Instant};

/// The port failed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Broken;

impl core::fmt::Display for Broken {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("broken")
    }
}

impl core::error::Error for Broken {}

impl embedded_io::Error for Broken {
    fn kind(&self) -> embedded_io::ErrorKind {
        embedded_io::ErrorKind::Other
    }
}

/// What a port does on one call.
#[derive(Arbitrary, Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Fault {
    /// Nothing unusual.
    None,
    /// Gives or takes at most this many bytes, at least one.
    Few(u8),
    Error,
    /// Reports an end of file, or takes nothing.
    Zero,
    /// Returns this many times 64 µs later; an async call is not ready until then.
    Late(u16),
}

/// The kinds of calls that can fail.
#[derive(Arbitrary, Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Call {
    Read,
    Write,
    Flush,
    /// The driver-enable pin.
    Pin,
}

/// The other end of the line: hears a byte that is complete at `at_us`, and may answer with bytes
/// that are complete at their times.
pub(super) trait Peer {
    fn hear(&mut self, byte: u8, at_us: u64) -> Vec<(u64, u8)>;
}

pub(super) struct World {
    pub(super) now_us: u64,
    /// Time of a byte on the line.
    byte_us: u64,
    /// When the last byte taken is out.
    free_us: u64,
    inbox: VecDeque<(u64, u8)>,
    faults: [VecDeque<Fault>; 4],
    sleepers: Vec<(u64, Waker)>,
    peer: Box<dyn Peer>,
    /// An empty inbox is an end of file.
    pub(super) is_file: bool,
    /// A blocking read without a byte fails, as with a time limit, instead of blocking forever.
    pub(super) is_short: bool,
    /// Calls of the port and of the clock.
    pub(super) calls: u64,
    /// Bytes given and taken, writes and flushes.
    pub(super) given: u64,
    pub(super) taken: Vec<u8>,
    /// What each write offered, and how many bytes of it were taken.
    pub(super) offers: Vec<(Vec<u8>, usize)>,
    /// Number of bytes that had been taken at the last flush that succeeded.
    pub(super) flushed: usize,
    pub(super) flushes: u64,
    pub(super) idles: u64,
    /// Time spent in late calls.
    pub(super) stalled_us: u64,
    pub(super) pin: bool,
}

/// A handle of the port, which is also the clock and the pin.
#[derive(Clone)]
pub(super) struct Port(Rc<RefCell<World>>);

impl core::fmt::Debug for Port {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Port")
    }
}

impl Port {
    pub(super) fn new(now_us: u64, byte_us: u64, peer: impl Peer + 'static) -> Self {
        Self(Rc::new(RefCell::new(World {
            now_us,
            byte_us,
            free_us: now_us,
            inbox: VecDeque::new(),
            faults: Default::default(),
            sleepers: Vec::new(),
            peer: Box::new(peer),
            is_file: false,
            is_short: false,
            calls: 0,
            given: 0,
            taken: Vec::new(),
            offers: Vec::new(),
            flushed: 0,
            flushes: 0,
            idles: 0,
            stalled_us: 0,
            pin: false,
        })))
    }

    pub(super) fn world(&self) -> RefMut<'_, World> {
        self.0.borrow_mut()
    }

    /// These bytes arrive, one after another, from now on.
    pub(super) fn receive(&self, bytes: &[u8]) {
        let mut world = self.world();
        let begin = world.inbox.back().map_or(0, |last| last.0).max(world.now_us);
        let byte_us = world.byte_us;
        world.inbox.extend(bytes.iter().zip(1..).map(|(&byte, n)| (begin + n * byte_us, byte)));
    }

    /// How long it takes until all bytes under way have arrived, microseconds.
    pub(super) fn under_way_us(&self) -> u64 {
        let world = self.world();
        world.inbox.back().map_or(0, |last| last.0.saturating_sub(world.now_us))
    }

    pub(super) fn fault(&self, call: Call, fault: Fault) {
        self.world().faults[call as usize].push_back(fault);
    }

    pub(super) fn heal(&self) {
        self.world().faults.iter_mut().for_each(VecDeque::clear);
    }

    pub(super) fn pass(&self, micros: u64) {
        self.world().now_us += micros;
    }
}

impl World {
    fn next(&mut self, call: Call) -> Fault {
        self.calls += 1;
        self.faults[call as usize].pop_front().unwrap_or(Fault::None)
    }

    fn has_arrived(&self) -> bool {
        self.inbox.front().is_some_and(|&(at, _)| at <= self.now_us)
    }

    fn give(&mut self, buffer: &mut [u8], most: usize) -> usize {
        assert!(!buffer.is_empty(), "an empty buffer would look like an end of file");
        let mut count = 0;
        while count < buffer.len().min(most) && self.has_arrived() {
            buffer[count] = self.inbox.pop_front().map_or(0, |(_, byte)| byte);
            count += 1;
        }
        self.given += count as u64;
        count
    }

    fn take(&mut self, bytes: &[u8], most: usize) -> usize {
        let count = bytes.len().min(most);
        self.offers.push((bytes.to_vec(), count));
        for &byte in &bytes[..count] {
            self.taken.push(byte);
            self.free_us = self.free_us.max(self.now_us) + self.byte_us;
            let answer = self.peer.hear(byte, self.free_us);
            for (at, byte) in answer {
                let at = self.inbox.back().map_or(0, |last| last.0).max(at);
                self.inbox.push_back((at, byte));
            }
        }
        count
    }

    /// Number of faults that are still to come.
    pub(super) fn faults(&self) -> usize {
        self.faults.iter().map(VecDeque::len).sum()
    }

    /// Whether a blocking read returns.
    pub(super) fn is_readable(&self) -> bool {
        let is_faulty = matches!(self.faults[0].front(), Some(Fault::Error | Fault::Zero));
        is_faulty || self.is_file || self.has_arrived()
    }

    /// The next read fails, whatever was planned.
    pub(super) fn fail_next_read(&mut self) {
        if self.faults[0].front() != Some(&Fault::Error) {
            self.faults[0].push_front(Fault::Error);
        }
    }

    /// The failure was not needed.
    pub(super) fn forget_read_failure(&mut self) {
        if self.faults[0].front() == Some(&Fault::Error) {
            self.faults[0].pop_front();
        }
    }

    /// Time until the last byte taken is out.
    pub(super) fn backlog_us(&self) -> u64 {
        self.free_us.saturating_sub(self.now_us)
    }

    fn late(&mut self, units: u16) {
        let micros = u64::from(units) * 64;
        self.now_us += micros;
        self.stalled_us += micros;
    }

    fn flushed(&mut self) {
        self.now_us = self.now_us.max(self.free_us);
        self.flushed = self.taken.len();
    }
}

impl Clock for Port {
    fn now(&mut self) -> Instant {
        self.world().calls += 1;
        Instant::from_micros(self.world().now_us)
    }

    fn idle_until(&mut self, until: Instant) {
        let mut world = self.world();
        (world.calls, world.idles) = (world.calls + 1, world.idles + 1);
        let arrival = world.inbox.front().map_or(u64::MAX, |&(at, _)| at);
        let now = Instant::from_micros(world.now_us);
        let span = u64::from((until - now).as_micros());
        world.now_us = (world.now_us + span).min(arrival).max(world.now_us + 1);
    }
}

impl embedded_hal::delay::DelayNs for Port {
    fn delay_ns(&mut self, ns: u32) {
        self.pass(u64::from(ns).div_ceil(1000));
    }
}

impl Port {
    fn switch(&self, is_on: bool) -> Result<(), Broken> {
        let mut world = self.world();
        let fault = world.next(Call::Pin);
        world.pin = is_on;
        if fault == Fault::Error { Err(Broken) } else { Ok(()) }
    }
}

impl embedded_hal::digital::Error for Broken {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl embedded_hal::digital::ErrorType for Port {
    type Error = Broken;
}

impl embedded_hal::digital::OutputPin for Port {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.switch(false)
    }

    fn set_high(&mut self) -> Result<(), Broken> {
        self.switch(true)
    }
}
