//! A line in virtual time, with a port and a clock that follow the test's instructions.
//!
//! Unlike the port of `harness/port.rs`, each reading of its clock takes time, motors are on its
//! line, and a write may depend on its bytes and on the time.

/// A call of a driver, blocking or async.
macro_rules! on {
    ($is_async:expr, $wire:expr, $it:ident, $call:ident, $call_async:ident($($value:expr),*)) => {
        match $is_async {
            true => $wire.block_on($it.$call_async($($value),*)),
            false => $it.$call($($value),*),
        }
    };
}

mod motor;

use std::{
    cell::{RefCell, RefMut},
    collections::VecDeque,
    future::{Future, poll_fn},
    pin::pin,
    rc::Rc,
    task::Poll,
};

pub(crate) use self::motor::Motor;
use crate::rig::*;

/// Time from a request to its answer, microseconds.
const ANSWER_US: u64 = 50;

/// What a port does with a write.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Write {
    All,
    /// Takes at most this many bytes.
    Some(usize),
    Error,
    /// Takes all bytes, but fails while some are still being sent.
    OneAtATime,
    /// Blocks for this long, microseconds, then takes at most this many bytes.
    Late(u64, usize),
    /// Takes at most this many bytes, waits until they are out, and then for this long,
    /// microseconds.
    Out(usize, u64),
}

/// Decides what the port does with each write.
type Writer = Box<dyn FnMut(&[u8]) -> Write>;

pub(crate) struct World {
    pub(crate) now_us: u64,
    pub(crate) motors: Vec<Motor>,
    /// Time of one byte on the line, microseconds.
    byte_us: u64,
    /// When the last byte sent will have left, microseconds.
    line_free_us: u64,
    /// Bytes sent, each with the time at which it left.
    pub(crate) sent: Vec<(u64, u8)>,
    /// Behind a driver-enable pin: bytes still in the transmitter.
    leaving: Option<VecDeque<(u64, u8)>>,
    /// Bytes received, each with the time at which it arrives.
    inbox: VecDeque<(u64, u8)>,
    writer: Writer,
    /// Every read fails.
    pub(crate) is_deaf: bool,
    /// Async writes are never ready.
    pub(crate) writes_hang: bool,
    /// Async flushes are never ready.
    pub(crate) flushes_hang: bool,
    /// After this many readings, one is wrong by this many microseconds.
    pub(crate) glitch: Option<(u32, u64)>,
}

/// The port and the clock of a driver. Clones share the port, clock and line.
#[derive(Clone)]
pub(crate) struct Wire(Rc<RefCell<World>>);

pub(crate) type Bus = Driver<Master, Wire, Wire>;

impl Wire {
    /// A line with these motors; a byte takes `byte_us`.
    pub(crate) fn new(byte_us: u64, motors: Vec<Motor>) -> Self {
        Self(Rc::new(RefCell::new(World {
            now_us: 0,
            motors,
            byte_us,
            line_free_us: 0,
            sent: vec![],
            leaving: None,
            inbox: VecDeque::new(),
            writer: Box::new(|_| Write::All),
            is_deaf: false,
            writes_hang: false,
            flushes_hang: false,
            glitch: None,
        })))
    }

    /// A bus of motors at 500 kbit/s.
    pub(crate) fn bus(motors: Vec<Motor>) -> Self {
        Self::new(20, motors)
    }

    /// A bus with node 1 alone, and its master, which has discovered it.
    pub(crate) fn one_motor(mode: Mode, change: impl FnOnce(&mut MasterConfig)) -> (Self, Bus) {
        let wire = Self::bus(vec![Motor::new(NodeId::N1, mode)]);
        let mut bus = wire.master(change);
        bus.discover().unwrap();
        (wire, bus)
    }

    /// A rover's link at 115,200 bit/s.
    pub(crate) fn link() -> Self {
        Self::new(87, vec![])
    }

    pub(crate) fn world(&self) -> RefMut<'_, World> {
        self.0.borrow_mut()
    }

    /// The master of node 1 alone.
    pub(crate) fn master(&self, change: impl FnOnce(&mut MasterConfig)) -> Bus {
        let mut config = MasterConfig::direct();
        config.nodes = NodeId::N1.into();
        change(&mut config);
        self.driver(|now| Master::new(config, now))
    }

    pub(crate) fn driver<R: Endpoint>(
        &self,
        role: impl FnOnce(Instant) -> R,
    ) -> Driver<R, Self, Self> {
        Driver::with(role, self.clone(), self.clone())
    }

    /// From now on the port handles each write like this.
    pub(crate) fn write_with(&self, writer: impl FnMut(&[u8]) -> Write + 'static) {
        self.world().writer = Box::new(writer);
    }

    /// The port takes all bytes.
    pub(crate) fn write_all(&self) {
        self.write_with(|_| Write::All);
    }

    /// The port takes this many more bytes, then it fails.
    pub(crate) fn write_only(&self, mut count: usize) {
        self.write_with(move |bytes| match count {
            0 => Write::Error,
            _ => {
                let taken = count.min(bytes.len());
                count -= taken;
                Write::Some(taken)
            }
        });
    }

    /// The next writes behave like this, later ones normally.
    pub(crate) fn write_as(&self, steps: impl IntoIterator<Item = Write>) {
        let mut steps: VecDeque<_> = steps.into_iter().collect();
        self.write_with(move |_| steps.pop_front().unwrap_or(Write::All));
    }

    /// These bytes arrive now.
    pub(crate) fn receive(&self, bytes: &[u8]) {
        self.receive_in(0, bytes);
    }

    /// These bytes arrive after this many microseconds.
    pub(crate) fn receive_in(&self, micros: u64, bytes: &[u8]) {
        let mut world = self.world();
        let at_us = world.now_us + micros;
        world.inbox.extend(bytes.iter().map(|&byte| (at_us, byte)));
    }

    /// The time of the world.
    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.world().now_us)
    }

    /// Lets time pass without calling the driver.
    pub(crate) fn pass(&self, micros: u64) {
        self.world().now_us += micros;
    }

    /// Speed of the first motor, rps.
    pub(crate) fn rps(&self) -> f32 {
        self.world().motors[0].rps()
    }

    /// Position of the first motor, turns.
    pub(crate) fn turns(&self) -> f64 {
        let mut world = self.world();
        let now_us = world.now_us;
        world.motors[0].move_on(now_us);
        world.motors[0].turns()
    }

    /// Runs a future to completion; time passes while it waits, up to a minute.
    pub(crate) fn block_on<T>(&self, future: impl Future<Output = T>) -> T {
        let mut future = pin!(future);
        for _ in 0..600_000 {
            if let Poll::Ready(output) = poll(future.as_mut()) {
                return output;
            }
            self.pass(100);
        }
        panic!("it has not returned after a minute");
    }

    /// The same; as soon as the future waits, these bytes arrive, and then another task holds the
    /// executor for this long.
    pub(crate) fn block_on_held<T>(
        &self,
        future: impl Future<Output = T>,
        bytes: &[u8],
        held_us: u64,
    ) -> T {
        let mut future = pin!(future);
        if let Poll::Ready(output) = poll(future.as_mut()) {
            return output;
        }
        self.receive(bytes);
        self.pass(held_us);
        self.block_on(future)
    }
}

/// Runs a driver for this long, through errors of its port.
pub(crate) fn run<R: Endpoint>(driver: &mut Driver<R, Wire, Wire>, millis: u32) {
    let end = driver.now() + Duration::from_millis(millis);
    while driver.now() < end {
        if driver.run_until(end, |_, _, _| ()).is_err() {
            driver.port().pass(100);
        }
    }
}

/// The master owes node 1 a stop, which its next calls send.
pub(crate) fn owe_stop(bus: &mut Bus) {
    let now = bus.now();
    bus.role_mut().stop(NodeId::N1, now);
}

impl World {
    fn send(&mut self, byte: u8) {
        self.line_free_us = self.line_free_us.max(self.now_us) + self.byte_us;
        let at = self.line_free_us;
        self.sent.push((at, byte));
        match &mut self.leaving {
            Some(leaving) => leaving.push_back((at, byte)),
            None => self.carry(at, byte),
        }
    }

    /// A byte has left: the motors receive it.
    fn carry(&mut self, at: u64, byte: u8) {
        for motor in &mut self.motors {
            let answer = motor.hear(byte, at).unwrap_or_default();
            let times = (1..).map(|count| at + ANSWER_US + self.byte_us * count);
            self.inbox.extend(times.zip(answer));
        }
    }

    /// Behind a driver-enable pin: delivers what has left by now.
    fn carry_on(&mut self) {
        while let Some(leaving) = &mut self.leaving {
            let Some(&(at, byte)) = leaving.front().filter(|it| it.0 <= self.now_us) else { break };
            leaving.pop_front();
            self.carry(at, byte);
        }
    }

    fn has_arrived(&self) -> bool {
        self.inbox.front().is_some_and(|&(at, _)| at <= self.now_us)
    }

    fn take(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        let mut stay_us = None;
        let count = match (self.writer)(bytes) {
            Write::All => bytes.len(),
            Write::Some(count) => count.min(bytes.len()),
            Write::Error => return Err(Unplugged),
            Write::OneAtATime if self.now_us < self.line_free_us => return Err(Unplugged),
            Write::OneAtATime => bytes.len(),
            Write::Late(micros, count) => {
                self.now_us += micros;
                count.min(bytes.len())
            }
            Write::Out(count, micros) => {
                stay_us = Some(micros);
                count.min(bytes.len())
            }
        };
        bytes[..count].iter().for_each(|&byte| self.send(byte));
        if let Some(stay_us) = stay_us {
            self.now_us = self.now_us.max(self.line_free_us) + stay_us;
        }
        Ok(count)
    }

    fn give(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        if self.is_deaf {
            return Err(Unplugged);
        }
        let mut count = 0;
        while count < buffer.len() && self.has_arrived() {
            buffer[count] = self.inbox.pop_front().unwrap().1;
            count += 1;
        }
        Ok(count)
    }
}

impl Clock for Wire {
    /// Each reading takes a microsecond.
    fn now(&mut self) -> Instant {
        let mut world = self.world();
        world.now_us += 1;
        world.carry_on();
        let wrong_us = match &mut world.glitch {
            Some((0, wrong_us)) => {
                let wrong_us = *wrong_us;
                world.glitch = None;
                wrong_us
            }
            Some((readings, _)) => {
                *readings -= 1;
                0
            }
            None => 0,
        };
        Instant::from_micros(world.now_us + wrong_us)
    }

    /// Idles until bytes arrive.
    fn idle_until(&mut self, until: Instant) {
        let mut world = self.world();
        let arrival = world.inbox.front().map_or(u64::MAX, |&(at, _)| at);
        world.now_us = until.as_micros().min(arrival).max(world.now_us + 1);
    }
}

impl embedded_hal_async::delay::DelayNs for Wire {
    async fn delay_ns(&mut self, ns: u32) {
        let end = self.world().now_us + u64::from(ns).div_ceil(1000);
        poll_fn(|_| match self.world().now_us >= end {
            true => Poll::Ready(()),
            false => Poll::Pending,
        })
        .await;
    }
}

/// The transceiver's pin: when off, bytes still in the transmitter do not reach the line.
impl embedded_hal::digital::OutputPin for Wire {
    fn set_low(&mut self) -> Result<(), Self::Error> {
        let mut world = self.world();
        world.carry_on();
        world.leaving = Some(VecDeque::new());
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

impl embedded_hal::digital::ErrorType for Wire {
    type Error = std::convert::Infallible;
}

impl embedded_io::ErrorType for Wire {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        let world = self.world();
        if world.is_deaf { Err(Unplugged) } else { Ok(world.has_arrived()) }
    }
}

impl embedded_io::Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.world().give(buffer)
    }
}

impl embedded_io::Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        self.world().take(bytes)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        let mut world = self.world();
        world.now_us = world.now_us.max(world.line_free_us);
        Ok(())
    }
}

impl embedded_io_async::Read for Wire {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        poll_fn(|_| {
            let mut world = self.world();
            match world.is_deaf || world.has_arrived() {
                true => Poll::Ready(world.give(buffer)),
                false => Poll::Pending,
            }
        })
        .await
    }
}

impl Wire {
    async fn until(&self, is_ready: impl Fn(&World) -> bool) {
        poll_fn(|_| if is_ready(&self.world()) { Poll::Ready(()) } else { Poll::Pending }).await;
    }
}

impl embedded_io_async::Write for Wire {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        self.until(|world| !world.writes_hang).await;
        self.world().take(bytes)
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.until(|world| !world.flushes_hang).await;
        embedded_io::Write::flush(self)
    }
}
