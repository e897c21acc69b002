//! The port of all tests, in virtual time, blocking and async: it gives and takes what its line and
//! its script say, fails and stalls, and records what it was asked to do.

mod virtual_time;

use std::{
    cell::{Cell, RefCell},
    collections::VecDeque,
    future::{Future, pending, poll_fn},
    pin::pin,
    rc::Rc,
    task::Poll,
};

#[allow(unused_imports, reason = "not every target uses all of them")]
pub(crate) use virtual_time::{Wakes, Wire, World, poll};

/// The port was pulled out.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Unplugged;

impl core::fmt::Display for Unplugged {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("unplugged")
    }
}

impl core::error::Error for Unplugged {}

impl embedded_io::Error for Unplugged {
    fn kind(&self) -> embedded_io::ErrorKind {
        embedded_io::ErrorKind::NotConnected
    }
}

/// A log that several parts write to.
pub(crate) type Log = Rc<RefCell<Vec<String>>>;

/// What the port does on one call.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// A read gives these bytes, whatever is on the line.
    Bytes(Vec<u8>),
    /// Gives or takes at most this many bytes.
    Few(usize),
    /// Fails.
    Error,
    /// Reports end of file, or that it takes nothing.
    Zero,
    /// Takes this long, microseconds; async calls are not ready until then, even if the first is
    /// dropped.
    Late(u64),
    /// Takes this long, microseconds, in an async call as well.
    Blocks(u64),
    /// Takes this long in the same way, and fails.
    BlocksAndFails(u64),
    /// Blocks for this long in the same way, and then takes at most this many bytes.
    Lags(u64, usize),
    /// Takes at most this many bytes, and blocks until they are out, and then for this long.
    Drains(usize, u64),
    /// Async only: this call never completes; the next one continues with the next step.
    Stall,
}

/// What a read does without a byte.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Empty {
    /// Waits; a blocking one must not happen.
    Waits,
    /// A blocking one fails, as with a time limit.
    Fails,
    /// Reports end of file.
    Ends,
}

/// What a write offered.
pub(crate) struct Offer {
    pub(crate) bytes: Vec<u8>,
    pub(crate) taken: usize,
    pub(crate) at_us: u64,
}

/// Hears each byte that has left, at its time, and answers with bytes that arrive at theirs.
pub(crate) type Peer = Box<dyn FnMut(u8, u64) -> Vec<(u64, u8)>>;

/// Decides what the port does with each write, instead of its script.
pub(crate) type Writer = Rc<RefCell<Option<Box<dyn FnMut(&[u8]) -> Step>>>>;

/// Follows its scripts; after that it gives what has arrived, and takes everything.
pub(crate) struct Port {
    pub(crate) world: World,
    pub(crate) reads: VecDeque<Step>,
    pub(crate) writes: VecDeque<Step>,
    pub(crate) writer: Writer,
    pub(crate) flushes: VecDeque<Step>,
    pub(crate) empty: Empty,
    /// Bytes on their way here.
    pub(crate) inbox: Wire,
    /// The other ends of the line: they receive what is written.
    pub(crate) outboxes: Vec<Wire>,
    pub(crate) peer: Option<Peer>,
    /// Time of one byte on the line, microseconds.
    pub(crate) byte_us: u64,
    /// When the last byte taken has left.
    pub(crate) free_us: u64,
    /// Bytes leave from this time on, microseconds; async flushes wait for it, others fail.
    pub(crate) holds_until_us: u64,
    /// Bytes arrive this much later, microseconds, as behind an adapter.
    pub(crate) delay_us: u64,
    /// A flush takes until all bytes have left.
    pub(crate) drains: bool,
    /// Most bytes taken per write.
    pub(crate) most: usize,
    /// A byte always seems available, and every read fails.
    pub(crate) is_deaf: bool,
    /// Asking for bytes fails.
    pub(crate) is_blind: bool,
    /// It becomes deaf when something is written.
    pub(crate) is_deafened: bool,
    /// Until when async writes are not ready, because of a step of one that was dropped.
    pub(crate) busy_until_us: Option<u64>,
    /// Every write fails.
    pub(crate) is_mute: bool,
    /// Async writes and flushes are ready only on the second poll.
    pub(crate) stutters: bool,
    /// Every call fails.
    pub(crate) unplugged: Rc<Cell<bool>>,
    /// Number of bytes given.
    pub(crate) given: u64,
    /// All bytes taken, and the writes in which they were.
    pub(crate) written: Vec<u8>,
    pub(crate) offers: Vec<Offer>,
    /// Number of flushes, of those that succeeded, and of bytes taken before the last of them.
    pub(crate) flush_calls: u64,
    pub(crate) flushed: usize,
    pub(crate) flushed_bytes: usize,
    /// Time of late calls, microseconds.
    pub(crate) stalled_us: u64,
    /// Every call of `write` and of `flush`.
    pub(crate) log: Option<Log>,
}

impl Default for Port {
    fn default() -> Self {
        Self::new(&World::default(), 0)
    }
}

impl Port {
    pub(crate) fn new(world: &World, byte_us: u64) -> Self {
        let inbox = Wire::default();
        world.add_line(&inbox);
        Self {
            world: world.clone(),
            reads: VecDeque::new(),
            writes: VecDeque::new(),
            writer: Rc::default(),
            flushes: VecDeque::new(),
            empty: Empty::Waits,
            inbox,
            outboxes: vec![],
            peer: None,
            byte_us,
            free_us: 0,
            holds_until_us: 0,
            delay_us: 0,
            drains: false,
            most: usize::MAX,
            is_deaf: false,
            is_blind: false,
            is_deafened: false,
            busy_until_us: None,
            is_mute: false,
            stutters: false,
            unplugged: Rc::default(),
            given: 0,
            written: vec![],
            offers: vec![],
            flush_calls: 0,
            flushed: 0,
            flushed_bytes: 0,
            stalled_us: 0,
            log: None,
        }
    }

    pub(crate) fn reading(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { reads: steps.into_iter().collect(), ..Self::default() }
    }

    pub(crate) fn file(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { empty: Empty::Ends, ..Self::reading(steps) }
    }

    pub(crate) fn writing(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { writes: steps.into_iter().collect(), ..Self::default() }
    }

    /// Two ends connected to each other.
    pub(crate) fn pair(world: &World, byte_us: u64) -> (Self, Self) {
        let (mut one, mut other) = (Self::new(world, byte_us), Self::new(world, byte_us));
        one.join(&mut other);
        (one, other)
    }

    /// Each end receives what the other one sends.
    pub(crate) fn join(&mut self, other: &mut Self) {
        self.outboxes.push(other.inbox.clone());
        other.outboxes.push(self.inbox.clone());
    }

    /// These bytes arrive, one after another, from now on.
    pub(crate) fn receive(&self, bytes: &[u8]) {
        let begin = self.last_arrival_us().max(self.world.now_us());
        let at = |count: u64| begin + count * self.byte_us;
        self.inbox.borrow_mut().extend(bytes.iter().zip(1..).map(|(&byte, n)| (at(n), byte)));
    }

    /// When all bytes under way have arrived, microseconds.
    pub(crate) fn last_arrival_us(&self) -> u64 {
        self.inbox.borrow().back().map_or(0, |last| last.0)
    }

    pub(crate) fn has_arrived(&self) -> bool {
        self.inbox.borrow().front().is_some_and(|&(at, _)| at <= self.world.now_us())
    }

    /// Whether a blocking read returns.
    pub(crate) fn is_readable(&self) -> bool {
        self.is_deaf
            || matches!(self.reads.front(), Some(Step::Bytes(_) | Step::Error | Step::Zero))
            || self.empty == Empty::Ends
            || self.has_arrived()
    }

    fn called(&self, call: &str) {
        self.world.count_call();
        if let Some(log) = &self.log {
            log.borrow_mut().push(call.into());
        }
    }

    fn is_plugged(&self) -> Result<(), Unplugged> {
        if self.unplugged.get() { Err(Unplugged) } else { Ok(()) }
    }

    /// Time passes inside of a call.
    async fn wait_until(&self, at_us: u64, is_async: bool) {
        match is_async {
            true => self.world.sleep_until(at_us).await,
            false if at_us > self.world.now_us() => self.world.step(at_us - self.world.now_us()),
            false => {}
        }
    }

    async fn stall(&mut self, micros: u64, is_async: bool) {
        self.stalled_us += micros;
        self.wait_until(self.world.now_us() + micros, is_async).await;
    }

    async fn reading_some(&mut self, buffer: &mut [u8], is_async: bool) -> Reply<usize> {
        assert!(!buffer.is_empty(), "an empty buffer would look like an end of file");
        if matches!(self.reads.front(), Some(Step::Stall)) {
            self.reads.pop_front();
            pending::<()>().await;
        }
        poll_fn(|context| {
            self.world.count_call();
            self.is_plugged()?;
            match is_async && !self.is_readable() {
                true => self.world.sleep_until_byte(&self.inbox, context),
                false => Poll::Ready(Ok(())),
            }
        })
        .await?;
        if self.is_deaf {
            return Err(Unplugged);
        }
        let most = match self.reads.pop_front() {
            Some(Step::Bytes(mut bytes)) => {
                let rest = bytes.split_off(bytes.len().min(buffer.len()));
                if !rest.is_empty() {
                    self.reads.push_front(Step::Bytes(rest));
                }
                buffer[..bytes.len()].copy_from_slice(&bytes);
                self.given += bytes.len() as u64;
                return Ok(bytes.len());
            }
            Some(Step::Error) => return Err(Unplugged),
            Some(Step::Zero) => return Ok(0),
            Some(Step::Few(count)) => count,
            Some(Step::Late(micros)) if !is_async => {
                self.stall(micros, false).await;
                usize::MAX
            }
            Some(_) | None => usize::MAX,
        };
        if !self.has_arrived() {
            assert!(self.empty != Empty::Waits, "a read without a byte would block forever");
            return if self.empty == Empty::Ends { Ok(0) } else { Err(Unplugged) };
        }
        let mut count = 0;
        while count < buffer.len().min(most) && self.has_arrived() {
            buffer[count] = self.inbox.borrow_mut().pop_front().map_or(0, |(_, byte)| byte);
            count += 1;
        }
        self.given += count as u64;
        Ok(count)
    }

    async fn writing_some(&mut self, bytes: &[u8], is_async: bool) -> Reply<usize> {
        // An async driver lets a stalled port go with an empty write.
        assert!(is_async || !bytes.is_empty(), "nothing to write");
        self.called("write");
        if bytes.is_empty() {
            // One that stalls does not take these either.
            if matches!(self.writes.front(), Some(Step::Stall)) {
                pending::<()>().await;
            }
            return Ok(0);
        }
        if is_async && self.stutters {
            self.world.stutter().await;
        }
        self.is_plugged()?;
        if self.is_mute {
            return Err(Unplugged);
        }
        let mut most = self.most;
        let step = match (&mut *self.writer.borrow_mut(), self.busy_until_us) {
            (_, Some(_)) => None,
            (Some(writer), None) => Some(writer(bytes)),
            (None, None) => self.writes.pop_front(),
        };
        match step {
            Some(Step::Few(count)) => most = most.min(count),
            Some(Step::Error) => return Err(Unplugged),
            Some(Step::Zero) => most = 0,
            Some(Step::Late(micros)) if is_async => {
                self.stalled_us += micros;
                self.busy_until_us = Some(self.world.now_us() + micros);
            }
            Some(Step::Late(micros)) => self.stall(micros, false).await,
            Some(Step::Blocks(micros)) => self.stall(micros, false).await,
            Some(Step::BlocksAndFails(micros)) => {
                self.stall(micros, false).await;
                return Err(Unplugged);
            }
            Some(Step::Lags(micros, count)) => {
                self.stall(micros, false).await;
                most = most.min(count);
            }
            Some(Step::Drains(count, micros)) => {
                let taken = self.take(bytes, most.min(count));
                self.wait_until(self.free_us + micros, false).await;
                return Ok(taken);
            }
            Some(Step::Stall) => pending().await,
            Some(Step::Bytes(_)) => panic!("a write gives nothing"),
            None => {}
        }
        if let Some(until_us) = self.busy_until_us.filter(|_| is_async) {
            self.wait_until(until_us, true).await;
            self.busy_until_us = None;
        }
        Ok(self.take(bytes, most))
    }

    fn take(&mut self, bytes: &[u8], most: usize) -> usize {
        let (taken, at_us) = (bytes.len().min(most), self.world.now_us());
        self.offers.push(Offer { bytes: bytes.to_vec(), taken, at_us });
        self.written.extend(&bytes[..taken]);
        self.is_deaf |= self.is_deafened;
        let begin_us = at_us.max(self.holds_until_us);
        for &byte in &bytes[..taken] {
            self.free_us = self.free_us.max(begin_us) + self.byte_us;
            for outbox in &self.outboxes {
                let mut outbox = outbox.borrow_mut();
                let line_free_us = outbox.back().map_or(0, |&(at, _)| at);
                outbox.push_back((line_free_us.max(begin_us + self.delay_us) + self.byte_us, byte));
            }
            if let Some(peer) = &mut self.peer {
                let answer = peer(byte, self.free_us);
                let mut inbox = self.inbox.borrow_mut();
                for (at, byte) in answer {
                    let at = inbox.back().map_or(0, |last| last.0).max(at);
                    inbox.push_back((at, byte));
                }
            }
        }
        taken
    }

    async fn flushing(&mut self, is_async: bool) -> Reply<()> {
        self.called("flush");
        self.flush_calls += 1;
        if is_async && self.stutters {
            self.world.stutter().await;
        }
        match self.flushes.pop_front() {
            Some(Step::Error | Step::Zero) => return Err(Unplugged),
            Some(Step::Late(micros)) => self.stall(micros, is_async).await,
            Some(Step::Blocks(micros)) => self.stall(micros, false).await,
            Some(Step::BlocksAndFails(micros)) => {
                self.stall(micros, false).await;
                return Err(Unplugged);
            }
            Some(Step::Stall) => pending().await,
            Some(Step::Few(_)) | None => {}
            Some(_) => panic!("a flush gives and takes nothing"),
        }
        if !is_async && self.world.now_us() < self.holds_until_us {
            return Err(Unplugged);
        }
        self.wait_until(self.holds_until_us, is_async).await;
        if self.drains {
            self.wait_until(self.free_us, is_async).await;
        }
        self.is_plugged()?;
        (self.flushed, self.flushed_bytes) = (self.flushed + 1, self.written.len());
        Ok(())
    }
}

type Reply<T> = Result<T, Unplugged>;

/// The result of a call that waits in no other way than by letting time pass.
fn at_once<T>(call: impl Future<Output = T>) -> T {
    match poll(pin!(call)) {
        Poll::Ready(result) => result,
        Poll::Pending => panic!("a blocking port cannot stall"),
    }
}

impl embedded_io::ErrorType for Port {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Port {
    fn read_ready(&mut self) -> Reply<bool> {
        self.world.count_call();
        self.is_plugged()?;
        if self.is_blind { Err(Unplugged) } else { Ok(self.is_readable()) }
    }
}

impl embedded_io::Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Reply<usize> {
        at_once(self.reading_some(buffer, false))
    }
}

impl embedded_io::Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Reply<usize> {
        at_once(self.writing_some(bytes, false))
    }

    fn flush(&mut self) -> Reply<()> {
        at_once(self.flushing(false))
    }
}

impl embedded_io_async::Read for Port {
    async fn read(&mut self, buffer: &mut [u8]) -> Reply<usize> {
        self.reading_some(buffer, true).await
    }
}

impl embedded_io_async::Write for Port {
    async fn write(&mut self, bytes: &[u8]) -> Reply<usize> {
        self.writing_some(bytes, true).await
    }

    async fn flush(&mut self) -> Reply<()> {
        self.flushing(true).await
    }
}
