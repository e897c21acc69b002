//! A port that does what a test says, and a role that writes down what is done to it.

use std::{cell::RefCell, collections::VecDeque, future::pending, rc::Rc};

use axlewire::{
    drive::{DriveError, Driver},
    endpoint::Endpoint,
    time::Instant,
};

use crate::world::{Unplugged, VirtualClock, World, poll};

/// What the port does at one call.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// Gives these bytes, or takes as many as there are.
    Bytes(Vec<u8>),
    /// Fails.
    Error,
    /// Says that the file has ended, or that it takes nothing.
    Zero,
    /// Async only: never answers this call; the next one goes on with the next step.
    Stall,
}

/// Follows its scripts. Then it has nothing to give, and takes everything.
#[derive(Debug, Default)]
pub(crate) struct Script {
    pub(crate) reads: VecDeque<Step>,
    pub(crate) writes: VecDeque<Step>,
    pub(crate) flushes: VecDeque<Step>,
    pub(crate) written: Vec<u8>,
    pub(crate) flushed: usize,
}

impl Script {
    pub(crate) fn reading(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { reads: steps.into_iter().collect(), ..Self::default() }
    }

    pub(crate) fn writing(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { writes: steps.into_iter().collect(), ..Self::default() }
    }

    fn give(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        match self.reads.pop_front().expect("a read without a byte would block for ever") {
            Step::Bytes(mut bytes) => {
                let rest = bytes.split_off(bytes.len().min(buffer.len()));
                if !rest.is_empty() {
                    self.reads.push_front(Step::Bytes(rest));
                }
                buffer[..bytes.len()].copy_from_slice(&bytes);
                Ok(bytes.len())
            }
            Step::Error => Err(Unplugged),
            Step::Zero => Ok(0),
            Step::Stall => panic!("a blocking port cannot stall"),
        }
    }

    fn take(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        assert!(!buffer.is_empty(), "nothing to write");
        let count = match self.writes.pop_front() {
            Some(Step::Bytes(bytes)) => bytes.len().min(buffer.len()),
            Some(Step::Error) => return Err(Unplugged),
            Some(Step::Zero) => 0,
            Some(Step::Stall) => panic!("a blocking port cannot stall"),
            None => buffer.len(),
        };
        self.written.extend(&buffer[..count]);
        Ok(count)
    }

    fn flushing(&mut self) -> Result<(), Unplugged> {
        match self.flushes.pop_front() {
            Some(Step::Error) => Err(Unplugged),
            _ => {
                self.flushed += 1;
                Ok(())
            }
        }
    }
}

/// Stays in this call for ever if the script says so; its next call goes on.
async fn stall(steps: &mut VecDeque<Step>) {
    if matches!(steps.front(), Some(Step::Stall)) {
        steps.pop_front();
        pending::<()>().await;
    }
}

impl embedded_io::ErrorType for Script {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Script {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        Ok(!self.reads.is_empty())
    }
}

impl embedded_io::Read for Script {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.give(buffer)
    }
}

impl embedded_io::Write for Script {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.take(buffer)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        self.flushing()
    }
}

impl embedded_io_async::Read for Script {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        stall(&mut self.reads).await;
        if self.reads.is_empty() {
            pending::<()>().await;
        }
        self.give(buffer)
    }
}

impl embedded_io_async::Write for Script {
    async fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        stall(&mut self.writes).await;
        self.take(buffer)
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        stall(&mut self.flushes).await;
        self.flushing()
    }
}

/// What was done to a role.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Call {
    Input(Vec<u8>),
    Timeout,
    Transmit(Option<Vec<u8>>),
}

/// Sends what it is told to, and writes down every call. Each byte received is an event.
#[derive(Default)]
pub(crate) struct Recorder {
    pub(crate) frames: VecDeque<Vec<u8>>,
    pub(crate) timeout: Option<Instant>,
    pub(crate) calls: Vec<Call>,
    pub(crate) received: Vec<u8>,
    pub(crate) events: VecDeque<u8>,
    last: Instant,
    packet: Vec<u8>,
    /// Looked at before each transmission: nothing may wait to be taken in.
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

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.at(now);
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

    fn poll_event(&mut self) -> Option<u8> {
        self.events.pop_front()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.timeout
    }
}

pub(crate) type Scripted = Driver<Recorder, Script, VirtualClock>;

pub(crate) fn scripted(role: Recorder, port: Script) -> Scripted {
    Driver::new(role, port, VirtualClock(World::default()))
}

/// A round, blocking or async; `None` for an async one that was dropped because it stalled.
pub(crate) type Round = fn(&mut Scripted) -> Option<Result<(), DriveError<Unplugged>>>;

fn round_blocking(driver: &mut Scripted) -> Option<Result<(), DriveError<Unplugged>>> {
    Some(driver.service())
}

fn round_async(driver: &mut Scripted) -> Option<Result<(), DriveError<Unplugged>>> {
    match poll(std::pin::pin!(driver.service_async())) {
        std::task::Poll::Ready(result) => Some(result),
        std::task::Poll::Pending => None,
    }
}

/// Both kinds of call, for the stories that hold for both.
pub(crate) const ROUNDS: [Round; 2] = [round_blocking, round_async];
pub(crate) const ASYNC: Round = round_async;

/// A log that several parts write to.
pub(crate) type Log = Rc<RefCell<Vec<String>>>;
