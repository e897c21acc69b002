//! A line whose other end is a motor, or nobody: it records what was sent, and each write may
//! depend on its bytes. Each reading of its clock takes a microsecond.

mod motor;

use std::{
    cell::{Cell, Ref, RefCell, RefMut},
    collections::VecDeque,
    pin::pin,
    rc::Rc,
    task::Poll,
};

pub(crate) use self::motor::Motor;
use crate::{port::Writer, rig::*};

/// Time from a request to its answer, microseconds.
const ANSWER_US: u64 = 50;

/// The port takes all bytes.
pub(crate) const ALL: Step = Step::Few(usize::MAX);

/// The other end of the port of a driver.
pub(crate) struct Wire {
    pub(crate) world: World,
    motor: Rc<RefCell<Option<Motor>>>,
    /// Bytes sent, each with the time at which it left.
    sent: Rc<RefCell<Vec<(u64, u8)>>>,
    inbox: crate::port::Wire,
    writer: Writer,
    /// Until a driver has it.
    port: Cell<Option<Port>>,
}

impl Wire {
    /// A byte takes `byte_us`.
    pub(crate) fn new(byte_us: u64, motor: Option<Motor>) -> Self {
        let world = World::default();
        world.take_per_reading(1);
        let mut port = Port::new(&world, byte_us);
        port.drains = true;
        let (motor, sent) = (Rc::new(RefCell::new(motor)), Rc::<RefCell<Vec<_>>>::default());
        let (hearing, log) = (motor.clone(), sent.clone());
        port.peer = Some(Box::new(move |byte, at| {
            log.borrow_mut().push((at, byte));
            let answer = hearing.borrow_mut().as_mut().and_then(|motor| motor.hear(byte, at));
            let times = (1..).map(|count| at + ANSWER_US + byte_us * count);
            times.zip(answer.unwrap_or_default()).collect()
        }));
        let (inbox, writer) = (port.inbox.clone(), port.writer.clone());
        Self { world, motor, sent, inbox, writer, port: Cell::new(Some(port)) }
    }

    /// A bus at 500 kbit/s, with node 1 in this mode, or with nobody.
    pub(crate) fn bus(mode: Option<Mode>) -> Self {
        Self::new(20, mode.map(|mode| Motor::new(NodeId::N1, mode)))
    }

    /// A bus with node 1 alone, and its master, which has discovered it.
    pub(crate) fn one_motor(mode: Mode, change: impl FnOnce(&mut MasterConfig)) -> (Self, Bus) {
        let wire = Self::bus(Some(mode));
        let mut bus = wire.master(change);
        bus.discover().unwrap();
        (wire, bus)
    }

    /// A rover's link at 115,200 bit/s.
    pub(crate) fn link() -> Self {
        Self::new(87, None)
    }

    /// The master of node 1 alone.
    pub(crate) fn master(&self, change: impl FnOnce(&mut MasterConfig)) -> Bus {
        let mut config = MasterConfig::direct();
        config.nodes = NodeId::N1.into();
        change(&mut config);
        self.driver(|now| Master::new(config, now))
    }

    pub(crate) fn driver<R: Endpoint>(&self, role: impl FnOnce(Instant) -> R) -> On<R> {
        On::with(role, self.port(), self.world.clone())
    }

    pub(crate) fn port(&self) -> Port {
        self.port.take().expect("a line has one driver")
    }

    /// From now on the port handles each write like this.
    pub(crate) fn write_with(&self, writer: impl FnMut(&[u8]) -> Step + 'static) {
        *self.writer.borrow_mut() = Some(Box::new(writer));
    }

    pub(crate) fn write_all(&self) {
        self.write_with(|_| ALL);
    }

    /// The port takes this many more bytes, then it fails.
    pub(crate) fn write_only(&self, mut count: usize) {
        self.write_with(move |bytes| match count {
            0 => Step::Error,
            _ => {
                let taken = count.min(bytes.len());
                count -= taken;
                Step::Few(taken)
            }
        });
    }

    /// The next writes behave like this, later ones normally.
    pub(crate) fn write_as(&self, steps: impl IntoIterator<Item = Step>) {
        let mut steps: VecDeque<_> = steps.into_iter().collect();
        self.write_with(move |_| steps.pop_front().unwrap_or(ALL));
    }

    /// These bytes arrive now.
    pub(crate) fn receive(&self, bytes: &[u8]) {
        self.receive_in(0, bytes);
    }

    /// These bytes arrive after this many microseconds.
    pub(crate) fn receive_in(&self, micros: u64, bytes: &[u8]) {
        let at_us = self.world.now_us() + micros;
        self.inbox.borrow_mut().extend(bytes.iter().map(|&byte| (at_us, byte)));
    }

    pub(crate) fn sent(&self) -> Ref<'_, Vec<(u64, u8)>> {
        self.sent.borrow()
    }

    pub(crate) fn motor(&self) -> RefMut<'_, Motor> {
        RefMut::map(self.motor.borrow_mut(), |motor| motor.as_mut().unwrap())
    }

    /// Speed of the motor, rps.
    pub(crate) fn rps(&self) -> f32 {
        self.motor().rps()
    }

    /// Position of the motor, turns.
    pub(crate) fn turns(&self) -> f64 {
        self.motor().move_on(self.world.now_us());
        self.motor().turns()
    }

    /// Runs a future to completion; as soon as it waits, these bytes arrive, and then another task
    /// holds the executor for this long.
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
        self.world.step(held_us);
        self.world.block_on(future)
    }
}

/// Runs a driver for this long, through errors of its port.
pub(crate) fn run<R: Endpoint>(driver: &mut On<R>, millis: u32) {
    let end = driver.now() + ms(millis);
    while driver.now() < end {
        let span = end - driver.now();
        if driver.run_for(span, |_, _, _| ()).is_err() {
            driver.port().world.step(100);
        }
    }
}

/// The master owes node 1 a stop, which its next calls send.
pub(crate) fn owe_stop(bus: &mut Bus) {
    let now = bus.now();
    bus.role_mut().stop(NodeId::N1, now);
}
