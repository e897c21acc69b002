//! Virtual time: a clock, its other participants, and an executor that polls only a woken task.

use std::{
    cell::{Cell, RefCell},
    collections::VecDeque,
    future::{Future, poll_fn},
    pin::{Pin, pin},
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Wake, Waker},
};

use axlewire::{drive::Clock, time::Instant};

/// The time that passes at once while others take part, microseconds.
const STEP_US: u64 = 20;

/// Bytes in flight, each with the time at which it arrives.
pub(crate) type Wire = Rc<RefCell<VecDeque<(u64, u8)>>>;

/// When the next byte arrives.
fn arrival_us(wire: &Wire) -> Option<u64> {
    wire.borrow().front().map(|&(at, _)| at)
}

/// Time, and its other participants. Clones are the same world, which is also a clock.
#[derive(Clone, Default)]
pub(crate) struct World(Rc<Inner>);

#[derive(Default)]
struct Inner {
    now_us: Cell<u64>,
    actors: RefCell<Vec<Box<dyn FnMut()>>>,
    /// Tasks that wait for a time, and for a byte: one for each line.
    sleepers: RefCell<Vec<(u64, Waker)>>,
    readers: RefCell<Vec<(Wire, Waker)>>,
    lines: RefCell<Vec<Wire>>,
    calls: Cell<u64>,
    naps: Cell<u64>,
    /// Time that each reading of the clock takes, microseconds.
    reading_us: Cell<u64>,
    /// After this many readings, one is wrong by this many microseconds.
    glitch: Cell<Option<(u32, u64)>>,
    /// After this many readings, the thread is held up for this long, microseconds.
    hold_ups: RefCell<VecDeque<(u32, u64)>>,
}

impl World {
    pub(crate) fn starting_at(now_us: u64) -> Self {
        let world = Self::default();
        world.0.now_us.set(now_us);
        world
    }

    pub(crate) fn now_us(&self) -> u64 {
        self.0.now_us.get()
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.now_us())
    }

    /// From now on each reading of the clock takes this long.
    pub(crate) fn take_per_reading(&self, micros: u64) {
        self.0.reading_us.set(micros);
    }

    /// After this many readings of the clock, one is wrong by this many microseconds.
    pub(crate) fn glitch(&self, readings: u32, wrong_us: u64) {
        self.0.glitch.set(Some((readings, wrong_us)));
    }

    /// After this many readings of the clock, since the end of the last hold-up, the thread is held
    /// up for this long, microseconds.
    pub(crate) fn hold_up(&self, readings: u32, micros: u64) {
        self.0.hold_ups.borrow_mut().push_back((readings, micros));
    }

    /// Calls of ports and clocks.
    pub(crate) fn calls(&self) -> u64 {
        self.0.calls.get()
    }

    /// How often a clock was asked to wait.
    pub(crate) fn naps(&self) -> u64 {
        self.0.naps.get()
    }

    pub(crate) fn count_call(&self) {
        self.0.calls.set(self.calls() + 1);
    }

    fn count_nap(&self) {
        self.count_call();
        self.0.naps.set(self.naps() + 1);
    }

    /// A line whose bytes end a blocking wait.
    pub(super) fn add_line(&self, wire: &Wire) {
        self.0.lines.borrow_mut().push(wire.clone());
    }

    /// Takes part in time: runs whenever some has passed.
    pub(crate) fn add(&self, actor: impl FnMut() + 'static) {
        self.0.actors.borrow_mut().push(Box::new(actor));
    }

    fn has_actors(&self) -> bool {
        !self.0.actors.borrow().is_empty()
    }

    /// Lets time pass and everything run.
    pub(crate) fn step(&self, micros: u64) {
        self.0.now_us.set(self.now_us() + micros);
        self.0.actors.borrow_mut().iter_mut().for_each(|actor| actor());
        // An actor may have changed anything, so each task looks again.
        let (now_us, is_all) = (self.now_us(), self.has_actors());
        let stays = |at: Option<u64>, waker: &Waker| {
            let is_woken = is_all || at.is_some_and(|at| at <= now_us);
            if is_woken {
                waker.wake_by_ref();
            }
            !is_woken
        };
        self.0.sleepers.borrow_mut().retain(|(at, waker)| stays(Some(*at), waker));
        self.0.readers.borrow_mut().retain(|(wire, waker)| stays(arrival_us(wire), waker));
    }

    /// The same in small steps: the others run often.
    pub(crate) fn pass(&self, micros: u64) {
        (0..micros.div_ceil(STEP_US)).for_each(|_| self.step(STEP_US));
    }

    /// Passes the time until a task is woken; `false` if nothing will ever wake one.
    fn wake_next(&self) -> bool {
        if self.has_actors() {
            self.step(STEP_US);
            return true;
        }
        let (sleepers, readers) = (self.0.sleepers.borrow(), self.0.readers.borrow());
        let arrivals = readers.iter().filter_map(|(wire, _)| arrival_us(wire));
        let next = sleepers.iter().map(|&(at, _)| at).chain(arrivals).min();
        drop((sleepers, readers));
        next.inspect(|at| self.step(at.saturating_sub(self.now_us()))).is_some()
    }

    /// The task is woken when a byte arrives.
    pub(super) fn sleep_until_byte<T>(&self, wire: &Wire, context: &Context<'_>) -> Poll<T> {
        let mut readers = self.0.readers.borrow_mut();
        readers.retain(|(other, _)| !Rc::ptr_eq(other, wire));
        readers.push((wire.clone(), context.waker().clone()));
        Poll::Pending
    }

    pub(super) async fn sleep_until(&self, at_us: u64) {
        poll_fn(|context| {
            if self.now_us() >= at_us {
                return Poll::Ready(());
            }
            self.0.sleepers.borrow_mut().push((at_us, context.waker().clone()));
            Poll::Pending
        })
        .await;
    }

    /// Not ready when it is polled first.
    pub(super) async fn stutter(&self) {
        self.sleep_until(self.now_us() + STEP_US).await;
    }

    /// Runs a future to completion.
    pub(crate) fn block_on<T>(&self, future: impl Future<Output = T>) -> T {
        self.run(None, future).expect("a lost wake-up: nothing will ever happen")
    }

    /// Polls a future this many times, then drops it.
    pub(crate) fn poll_times<T>(&self, times: usize, future: impl Future<Output = T>) -> Option<T> {
        self.run(Some(times), future)
    }

    /// Like a real executor it polls only a woken task; otherwise time passes.
    pub(crate) fn run<T>(&self, most: Option<usize>, future: impl Future<Output = T>) -> Option<T> {
        let mut future = pin!(future);
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let (mut polls, mut seen) = (0, usize::MAX);
        let output = loop {
            if wakes.count() == seen {
                if !self.wake_next() {
                    break None;
                }
                continue;
            }
            if most == Some(polls) {
                break None;
            }
            (polls, seen) = (polls + 1, wakes.count());
            assert!(polls < 6_000_000, "endless polls");
            if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
                break Some(output);
            }
        };
        self.0.sleepers.borrow_mut().clear();
        self.0.readers.borrow_mut().clear();
        output
    }
}

impl Clock for World {
    fn now(&self) -> Instant {
        self.count_call();
        // Not a reading of an actor.
        if self.0.actors.try_borrow_mut().is_ok() {
            let next = self.0.hold_ups.borrow_mut().pop_front();
            match next {
                Some((0, us)) => self.pass(us),
                Some((readings, us)) => {
                    self.0.hold_ups.borrow_mut().push_front((readings - 1, us));
                }
                None => {}
            }
        }
        let now_us = self.now_us() + self.0.reading_us.get();
        self.0.now_us.set(now_us);
        let glitch = self.0.glitch.take();
        let later = glitch.and_then(|(readings, us)| Some((readings.checked_sub(1)?, us)));
        self.0.glitch.set(later);
        let wrong_us = glitch.filter(|_| later.is_none()).map_or(0, |(_, us)| us);
        Instant::from_micros(now_us + wrong_us)
    }

    /// Idles until a byte arrives; others run meanwhile.
    fn idle_until(&mut self, until: Instant) {
        self.count_nap();
        let now_us = self.now_us();
        let coming = |wire: &Wire| {
            let wire = wire.borrow();
            wire.get(wire.partition_point(|&(at, _)| at <= now_us)).map(|&(at, _)| at - now_us)
        };
        let most = match self.has_actors() {
            true => Some(STEP_US),
            false => self.0.lines.borrow().iter().filter_map(coming).min(),
        };
        let span = u64::from((until - Self::now(self)).as_micros());
        // At least one, so that idling always advances time.
        self.step(span.min(most.unwrap_or(u64::MAX)).max(1));
    }
}

impl embedded_hal::delay::DelayNs for World {
    fn delay_ns(&mut self, ns: u32) {
        self.step(u64::from(ns).div_ceil(1000));
    }
}

impl embedded_hal_async::delay::DelayNs for World {
    async fn delay_ns(&mut self, ns: u32) {
        self.count_nap();
        self.sleep_until(self.now_us() + u64::from(ns).div_ceil(1000)).await;
    }
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

/// Polls once; nobody is woken.
pub(crate) fn poll<T>(future: Pin<&mut impl Future<Output = T>>) -> Poll<T> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}
