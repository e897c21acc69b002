//! A role that records every call, for the tests of the loop that drives it.

use std::{collections::VecDeque, pin::pin, rc::Rc, task::Poll};

use crate::rig::*;

/// So many bytes to be read.
pub(crate) fn bytes(count: usize) -> Step {
    Step::Bytes(vec![0; count])
}

/// What was done to a role.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Call {
    Input(Vec<u8>),
    Timeout,
    Transmit(Option<Vec<u8>>),
    Unsent(Unsent),
}

/// Sends what it is given, and records every call. Each received byte is an event.
#[derive(Default)]
pub(crate) struct Recorder {
    pub(crate) frames: VecDeque<Vec<u8>>,
    pub(crate) timeout: Option<Instant>,
    /// A frame of which no byte has left is sent again.
    pub(crate) repeats: bool,
    pub(crate) calls: Vec<Call>,
    /// When a frame had been taken, and when all had left.
    pub(crate) taken_at: Vec<Instant>,
    pub(crate) flushed_at: Vec<Instant>,
    pub(crate) received: Vec<u8>,
    pub(crate) events: VecDeque<u8>,
    last: Instant,
    packet: Vec<u8>,
    /// Checked before each transmission: no received bytes may be waiting.
    pub(crate) nothing_waits: Option<Rc<dyn Fn() -> bool>>,
}

impl Recorder {
    pub(crate) fn sending(frames: &[&[u8]]) -> Self {
        Self { frames: frames.iter().map(|frame| frame.to_vec()).collect(), ..Self::default() }
    }

    fn at(&mut self, now: Instant) {
        assert!(now >= self.last, "time went backwards");
        self.last = now;
    }
}

impl Endpoint for Recorder {
    type Event = u8;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        self.at(arrived.into().now());
        self.calls.push(Call::Input(bytes.to_vec()));
        self.received.extend(bytes);
        self.events.extend(bytes);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.at(now);
        if self.timeout.is_some_and(|at| now >= at) {
            self.timeout = None;
        }
        self.calls.push(Call::Timeout);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.at(now);
        if let Some(nothing_waits) = &self.nothing_waits {
            assert!(nothing_waits(), "received bytes come before the next transmission");
        }
        let frame = self.frames.pop_front();
        self.calls.push(Call::Transmit(frame.clone()));
        self.packet = frame?;
        Some(&self.packet)
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.at(now);
        match outcome.into() {
            Transmit::Taken => self.taken_at.push(now),
            Transmit::Flushed => self.flushed_at.push(now),
            Transmit::Unsent(unsent) => {
                self.calls.push(Call::Unsent(unsent));
                if self.repeats && unsent == Unsent::Untouched {
                    self.frames.push_front(self.packet.clone());
                }
            }
        }
    }

    fn poll_event(&mut self) -> Option<u8> {
        self.events.pop_front()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.timeout
    }
}

/// A round, blocking or async; `None` for an async one that stalled and was dropped.
pub(crate) type Round = fn(&mut On<Recorder>) -> Option<Result<(), DriveError<Unplugged>>>;

fn round_blocking(driver: &mut On<Recorder>) -> Option<Result<(), DriveError<Unplugged>>> {
    Some(driver.service())
}

fn round_async(driver: &mut On<Recorder>) -> Option<Result<(), DriveError<Unplugged>>> {
    let mut round = pin!(driver.asynch().service());
    // A call that fails yields once.
    for _ in 0..2 {
        if let Poll::Ready(result) = poll(round.as_mut()) {
            return Some(result);
        }
    }
    None
}

/// Both kinds of call, for scenarios that apply to both.
pub(crate) const ROUNDS: [Round; 2] = [round_blocking, round_async];
pub(crate) const ASYNC: Round = round_async;

impl Recorder {
    /// What it was told about frames that did not leave.
    pub(crate) fn unsent(&self) -> Vec<Unsent> {
        let unsent = |call: &Call| match call {
            Call::Unsent(unsent) => Some(*unsent),
            _ => None,
        };
        self.calls.iter().filter_map(unsent).collect()
    }
}
