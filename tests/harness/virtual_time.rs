//! Ports and clocks in virtual time, for the driver tests.
//!
//! The port is one end of a simulated line: unlike the scripted one of `port.rs` it gives bytes
//! that others have sent, once they have arrived, and wakes a task waiting for them.

use std::{
    cell::{Cell, RefCell},
    collections::VecDeque,
    future::{Future, poll_fn},
    pin::pin,
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Wake, Waker},
};

use axlewire::{drive::Clock, time::Instant};

use crate::port::Unplugged;

type Actor = Box<dyn FnMut()>;

/// Time, and its other participants.
#[derive(Clone, Default)]
pub(crate) struct World {
    micros: Rc<Cell<u64>>,
    actors: Rc<RefCell<Vec<Actor>>>,
    sleepers: Rc<RefCell<Vec<Waker>>>,
}

/// Counts wake-ups of a task.
#[derive(Default)]
pub(crate) struct Wakes(AtomicUsize);

impl Wakes {
    pub(crate) fn count(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }
}

impl Wake for Wakes {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

impl World {
    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.micros.get())
    }

    pub(crate) fn add(&self, actor: impl FnMut() + 'static) {
        self.actors.borrow_mut().push(Box::new(actor));
    }

    /// Lets time pass and everything run.
    pub(crate) fn step(&self, micros: u64) {
        self.micros.set(self.micros.get() + micros);
        for actor in &mut *self.actors.borrow_mut() {
            actor();
        }
        self.sleepers.borrow_mut().drain(..).for_each(Waker::wake);
    }

    /// The task is woken when time has passed.
    fn sleep<T>(&self, context: &Context<'_>) -> Poll<T> {
        self.sleepers.borrow_mut().push(context.waker().clone());
        Poll::Pending
    }

    /// Runs a future to completion, which has to come within a minute of virtual time.
    pub(crate) fn block_on<T>(&self, future: impl Future<Output = T>) -> T {
        self.poll_times(usize::MAX, future).expect("hangs")
    }

    /// Polls a future this many times, then drops it. Like a real executor it polls only a woken
    /// task; otherwise time passes.
    pub(crate) fn poll_times<T>(&self, times: usize, future: impl Future<Output = T>) -> Option<T> {
        let mut future = pin!(future);
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let (mut polls, mut seen) = (0, usize::MAX);
        for _ in 0..6_000_000 {
            if wakes.count() == seen {
                self.step(20);
                continue;
            }
            if polls == times {
                return None;
            }
            seen = wakes.count();
            if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
                return Some(output);
            }
            polls += 1;
        }
        None
    }
}

/// Idling on this clock lets the others run.
#[derive(Clone, Default)]
pub(crate) struct VirtualClock(pub(crate) World);

impl Clock for VirtualClock {
    fn now(&mut self) -> Instant {
        self.0.now()
    }

    fn idle_until(&mut self, until: Instant) {
        // At least one, so that idling always advances time.
        self.0.step(u64::from((until - self.0.now()).as_micros()).clamp(1, 20));
    }
}

impl embedded_hal_async::delay::DelayNs for VirtualClock {
    async fn delay_ns(&mut self, ns: u32) {
        let world = self.0.clone();
        let end = world.micros.get() + u64::from(ns).div_ceil(1000);
        poll_fn(|context| match world.micros.get() >= end {
            true => Poll::Ready(()),
            false => world.sleep(context),
        })
        .await;
    }
}

/// Bytes in flight, each with the time at which it arrives.
pub(crate) type Wire = Rc<RefCell<VecDeque<(u64, u8)>>>;

/// One end of a line: all other ends receive what it sends.
pub(crate) struct End {
    world: World,
    pub(crate) inbox: Wire,
    pub(crate) outboxes: Vec<Wire>,
    /// Time of one byte on the line, microseconds.
    byte_us: u64,
    /// Most bytes taken per write.
    pub(crate) most: usize,
    /// The port takes this many more bytes, and then fails once.
    pub(crate) fails_after: Option<usize>,
    /// The next flush fails, although the bytes leave.
    pub(crate) fails_flush: bool,
    /// The receiver fails this many times, at the next checks for bytes.
    pub(crate) failing_reads: u32,
    /// A byte always seems available, and every read fails.
    pub(crate) is_deaf: bool,
    /// The receiver fails when something is written.
    pub(crate) is_deafened: bool,
    /// Every write fails.
    pub(crate) is_mute: bool,
    /// The next write takes this long before its bytes leave, and the next flush this long, in one
    /// call.
    pub(crate) stalls_us: [u64; 2],
    /// Bytes leave from this time on, microseconds; async flushes wait for it, others fail.
    pub(crate) holds_until_us: u64,
    /// Bytes arrive this much later, microseconds, as behind an adapter.
    pub(crate) delay_us: u64,
    /// Async writes and flushes are ready only on the second poll.
    pub(crate) stutters: bool,
    /// All bytes taken, and when each write took some.
    pub(crate) written: Vec<u8>,
    pub(crate) taken_at_us: Vec<(usize, u64)>,
    pub(crate) unplugged: Rc<Cell<bool>>,
}

impl End {
    pub(crate) fn new(world: &World, byte_us: u64) -> Self {
        Self {
            world: world.clone(),
            inbox: Wire::default(),
            outboxes: vec![],
            byte_us,
            most: usize::MAX,
            fails_after: None,
            fails_flush: false,
            failing_reads: 0,
            is_deaf: false,
            is_deafened: false,
            is_mute: false,
            stalls_us: [0; 2],
            holds_until_us: 0,
            delay_us: 0,
            stutters: false,
            written: vec![],
            taken_at_us: vec![],
            unplugged: Rc::default(),
        }
    }

    /// Two ends connected to each other.
    pub(crate) fn pair(world: &World, byte_us: u64) -> (Self, Self) {
        let (mut one, mut other) = (Self::new(world, byte_us), Self::new(world, byte_us));
        one.outboxes.push(other.inbox.clone());
        other.outboxes.push(one.inbox.clone());
        (one, other)
    }

    fn is_plugged(&self) -> Result<(), Unplugged> {
        if self.unplugged.get() { Err(Unplugged) } else { Ok(()) }
    }

    fn fail_read(&mut self) -> Result<(), Unplugged> {
        let is_good = self.failing_reads == 0;
        self.failing_reads = self.failing_reads.saturating_sub(1);
        if is_good { Ok(()) } else { Err(Unplugged) }
    }

    pub(crate) fn has_arrived(&self) -> bool {
        self.inbox.borrow().front().is_some_and(|&(at, _)| at <= self.world.micros.get())
    }

    fn give(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.is_plugged()?;
        if self.is_deaf {
            return Err(Unplugged);
        }
        assert!(self.has_arrived(), "read without a byte would block forever");
        let mut count = 0;
        for slot in buffer {
            if !self.has_arrived() {
                break;
            }
            *slot = self.inbox.borrow_mut().pop_front().unwrap().1;
            count += 1;
        }
        Ok(count)
    }

    fn take(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.is_plugged()?;
        if self.is_mute {
            return Err(Unplugged);
        }
        let mut count = buffer.len().min(self.most);
        if let Some(left) = self.fails_after {
            count = count.min(left);
            self.fails_after = (left > 0).then_some(left - count);
            if left == 0 {
                return Err(Unplugged);
            }
        }
        self.stall(0);
        self.written.extend(&buffer[..count]);
        self.taken_at_us.push((count, self.world.micros.get()));
        self.is_deaf |= self.is_deafened;
        for outbox in &self.outboxes {
            let mut outbox = outbox.borrow_mut();
            for &byte in &buffer[..count] {
                let begin = self.world.micros.get().max(self.holds_until_us) + self.delay_us;
                let free = outbox.back().map_or(0, |&(at, _)| at).max(begin);
                outbox.push_back((free + self.byte_us, byte));
            }
        }
        Ok(count)
    }

    fn stall(&mut self, call: usize) {
        match core::mem::take(&mut self.stalls_us[call]) {
            0 => {}
            micros => self.world.step(micros),
        }
    }

    fn finish(&mut self) -> Result<(), Unplugged> {
        self.is_plugged()?;
        self.stall(1);
        if core::mem::take(&mut self.fails_flush) { Err(Unplugged) } else { Ok(()) }
    }

    async fn stutter(&self) {
        let mut ready = !self.stutters;
        poll_fn(|context| match core::mem::replace(&mut ready, true) {
            true => Poll::Ready(()),
            false => self.world.sleep(context),
        })
        .await;
    }
}

impl embedded_io::ErrorType for End {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for End {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        self.is_plugged()?;
        self.fail_read()?;
        Ok(self.is_deaf || self.has_arrived())
    }
}

impl embedded_io::Read for End {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.give(buffer)
    }
}

impl embedded_io::Write for End {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.take(buffer)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        if self.world.micros.get() < self.holds_until_us {
            return Err(Unplugged);
        }
        self.finish()
    }
}

impl embedded_io_async::Read for End {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.fail_read()?;
        poll_fn(|context| match self.is_plugged() {
            Ok(()) if !self.is_deaf && !self.has_arrived() => self.world.sleep(context),
            _ => Poll::Ready(self.give(buffer)),
        })
        .await
    }
}

impl embedded_io_async::Write for End {
    async fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.stutter().await;
        self.take(buffer)
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.stutter().await;
        poll_fn(|context| match self.world.micros.get() >= self.holds_until_us {
            true => Poll::Ready(()),
            false => self.world.sleep(context),
        })
        .await;
        self.finish()
    }
}
