//! The bus and the rover of the scenarios, and calls that are blocking or async.

use std::{
    cell::{Cell, RefCell},
    ops::{Deref, DerefMut},
    rc::Rc,
};

#[cfg(feature = "ucp")]
pub(crate) use axlewire::ucp::{
    Body, Host, MotorControl, Robot, Telemetry,
    host::HostConfig,
    message::CalibrationKind,
    robot::{RobotConfig, RobotEvent},
};
/// What the scenarios use of the library, and their port.
pub(crate) use axlewire::{
    drive::{Clock, DriveError, Driver, Operation, Rs485, Rs485Error, WithDelay, asynch},
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position, PositionResponse, ReadRequest, Rps, Slave, Status, Target,
        WriteRequest,
        board::OneMotor,
        master::{
            Cause, CommandError, Health, MasterConfig, MasterEvent, NodeSet, Polling, StopProgress,
        },
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

pub(crate) use crate::port::{Port, Step, Unplugged, World, poll};
pub(crate) use crate::{
    pin::{Pin, drain, is_on, ready, undelayed},
    recorder::{ASYNC, Call, ROUNDS, Recorder, bytes},
};

/// The blocking form of a call, or the async one.
macro_rules! call {
    ($is_async:expr, $driver:expr, $name:ident($($argument:expr),*)) => {
        match $is_async {
            true => {
                let world = $driver.port().world.clone();
                world.block_on($driver.asynch().$name($($argument),*))
            }
            false => $driver.$name($($argument),*),
        }
    };
}

/// Drops a call before its first poll, then after one, and so on, until it is done within them.
/// That takes more than `least` polls.
pub(crate) fn dropped_at_any_await(least: usize, mut is_done_within: impl FnMut(usize) -> bool) {
    let polls = (0..).find(|&polls| is_done_within(polls)).unwrap();
    assert!(polls > least, "{polls}");
}

pub(crate) const BOTH: [bool; 2] = [false, true];
pub(crate) const GONE: DriveError<Unplugged> = DriveError::Port(Unplugged);

pub(crate) const fn ms(millis: u32) -> Duration {
    Duration::from_millis(millis)
}

pub(crate) const fn at_ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

/// What both forms of a call return.
pub(crate) fn both<T: PartialEq + core::fmt::Debug>(call: impl Fn(bool) -> T) -> T {
    let blocking = call(false);
    assert_eq!(call(true), blocking, "async");
    blocking
}

/// A role behind a driver on a port: its calls are blocking.
#[derive(Clone, Debug)]
pub(crate) struct On<R, P = Port, C = World>(asynch::Driver<R, P, C>);

impl<R: Endpoint, P, C: Clock> On<R, P, C> {
    pub(crate) fn new(role: R, port: P, clock: C) -> Self {
        Self(asynch::Driver::new(role, port, clock))
    }

    pub(crate) fn with(role: impl FnOnce(Instant) -> R, port: P, clock: C) -> Self {
        Self(asynch::Driver::with(role, port, clock))
    }

    /// The same driver, with async calls.
    pub(crate) fn asynch(&mut self) -> &mut asynch::Driver<R, P, C> {
        &mut self.0
    }

    pub(crate) fn into_parts(self) -> (R, P, C) {
        self.0.into_parts()
    }
}

impl<R, P, C> Deref for On<R, P, C> {
    type Target = Driver<R, P, C>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<R, P, C> DerefMut for On<R, P, C> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

/// A role that runs whenever virtual time passes.
pub(crate) type Running<R> = Rc<RefCell<On<R>>>;

/// A role on a port.
pub(crate) fn on<R: Endpoint>(role: R, port: Port) -> On<R> {
    let world = port.world.clone();
    On::new(role, port, world)
}

/// A clock with these readings, microseconds.
pub(crate) fn clock_that_says(readings: impl IntoIterator<Item = u64>) -> impl Fn() -> Instant {
    let readings = RefCell::new(readings.into_iter());
    move || Instant::from_micros(readings.borrow_mut().next().unwrap())
}

/// The same role and port in another driver.
pub(crate) fn in_another_driver<R: Endpoint>(driver: On<R>) -> On<R> {
    let (role, port, clock) = driver.into_parts();
    On::new(role, port, clock)
}

/// A role that runs whenever virtual time passes, unless it is unplugged: then it hears nothing.
pub(crate) fn run<R: Endpoint + 'static>(role: R, port: Port) -> Running<R> {
    let world = port.world.clone();
    let running = Rc::new(RefCell::new(on(role, port)));
    let actor = running.clone();
    world.add(move || {
        if let Ok(mut driver) = actor.try_borrow_mut() {
            if driver.port().unplugged.get() {
                driver.port().inbox.borrow_mut().clear();
            } else {
                driver.service().unwrap();
            }
        }
    });
    running
}

/// All events that wait.
pub(crate) fn events<R: Endpoint>(driver: &mut On<R>) -> Vec<R::Event> {
    core::iter::from_fn(|| driver.poll_event()).collect()
}

// The bus

pub(crate) type Bus = On<Master>;

/// A master, and two slaves that run whenever virtual time passes: node 2 in velocity mode, node 5
/// in position mode.
pub(crate) struct Story {
    pub(crate) world: World,
    pub(crate) bus: Bus,
    pub(crate) two: Running<Slave>,
    pub(crate) five: Running<Slave>,
    /// Whether the motor of node 2 turns as it is told.
    pub(crate) two_obeys: Rc<Cell<bool>>,
}

impl Story {
    pub(crate) fn new(config: MasterConfig) -> Self {
        let world = World::default();
        let mut near = Port::new(&world, 20);
        let mut node = |id, mode| {
            let mut far = Port::new(&world, 20);
            far.join(&mut near);
            run(Slave::new(id, mode, SlaveConfig::direct(), at_ms(0)), far)
        };
        let (two, five) = (node(NodeId::N2, Mode::Velocity), node(NodeId::N5, Mode::Position));
        two.borrow_mut().role_mut().set_velocity(rps(0.5));
        five.borrow_mut().role_mut().set_position(HERE);
        let two_obeys = Rc::new(Cell::new(true));
        let (motor, obeys, clock) = (two.clone(), two_obeys.clone(), world.clone());
        world.add(move || {
            if let Ok(mut motor) = motor.try_borrow_mut() {
                let told = motor.role().command(clock.now()).filter(|_| obeys.get());
                if let Some(Target::Velocity(rps)) = told {
                    motor.role_mut().set_velocity(rps);
                }
            }
        });
        let bus = on(Master::new(config, world.now()), near);
        Self { world, bus, two, five, two_obeys }
    }

    pub(crate) fn discovered(mut self) -> Self {
        assert_eq!(self.bus.discover().unwrap(), FOUND);
        self
    }

    /// Reads a node once more.
    pub(crate) fn ask(&mut self, node: NodeId) {
        let now = self.bus.now();
        self.bus.role_mut().read(node, now).unwrap();
    }

    /// Runs the master's driver for a while.
    pub(crate) fn run(&mut self, millis: u32) {
        self.bus.run_for(ms(millis), |_, _, _| ()).unwrap();
    }

    /// What node 2 is told to do, once everything on the line has arrived, whether or not the
    /// master is called again.
    pub(crate) fn told_two(&self) -> Option<Target<OneMotor>> {
        self.world.pass(1000);
        self.two.borrow().role().command(self.world.now())
    }

    pub(crate) fn told_five(&self) -> Option<Target<OneMotor>> {
        self.world.pass(1000);
        self.five.borrow().role().command(self.world.now())
    }

    pub(crate) fn unplug_two(&self, is_unplugged: bool) {
        self.two.borrow().port().unplugged.set(is_unplugged);
    }
}

pub(crate) const FOUND: [(NodeId, Mode); 2] =
    [(NodeId::N2, Mode::Velocity), (NodeId::N5, Mode::Position)];

/// Where node 5 is.
pub(crate) const HERE: Position = Position::new(7, 1);
pub(crate) const HELD: Option<Target<OneMotor>> = Some(Target::Position(HERE));
pub(crate) const STOPPED: Option<Target<OneMotor>> = Some(Target::Velocity(Rps::ZERO));

pub(crate) fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

pub(crate) const fn only(node: NodeId) -> NodeSet {
    let mut nodes = NodeSet::NONE;
    nodes.insert(node);
    nodes
}

/// Settings of a bus that has no other nodes.
pub(crate) fn only_two_and_five() -> MasterConfig {
    let mut config = MasterConfig::direct();
    config.nodes = [NodeId::N2, NodeId::N5].into_iter().collect();
    config
}

pub(crate) fn manual() -> MasterConfig {
    let mut config = MasterConfig::direct();
    (config.polling, config.attempts) = (Polling::Manual, 1);
    config
}

/// Node 2 alone, and the other end of its line.
pub(crate) fn slave(config: SlaveConfig) -> (On<Slave>, Port) {
    let (near, far) = Port::pair(&World::default(), 20);
    (on(Slave::new(NodeId::N2, Mode::Velocity, config, at_ms(0)), near), far)
}

// The rover

/// Time of one byte at 115,200 bit/s, microseconds.
#[cfg(feature = "ucp")]
pub(crate) const BYTE_US: u64 = 87;

#[cfg(feature = "ucp")]
pub(crate) type Rover = On<Host>;

/// A host, and a robot that reports its battery; it runs whenever virtual time passes.
#[cfg(feature = "ucp")]
pub(crate) fn rover(change: impl FnOnce(&mut HostConfig)) -> (World, Rover, Running<Robot>) {
    let world = World::default();
    let (near, far) = Port::pair(&world, BYTE_US);
    let mut robot = Robot::new(RobotConfig::default(), world.now());
    robot.set_telemetry(&Telemetry { battery_pct: 87, ..Telemetry::default() }, world.now());
    let robot = run(robot, far);
    let mut config = HostConfig::default();
    change(&mut config);
    (world.clone(), on(Host::new(config, world.now()), near), robot)
}

/// A host whose robot does not answer.
#[cfg(feature = "ucp")]
pub(crate) fn host() -> Rover {
    on(Host::new(HostConfig::default(), at_ms(0)), Port::new(&World::default(), BYTE_US))
}

/// A robot alone, and the other end of its line.
#[cfg(feature = "ucp")]
pub(crate) fn robot() -> (On<Robot>, Port) {
    let (near, far) = Port::pair(&World::default(), BYTE_US);
    (on(Robot::new(RobotConfig::default(), at_ms(0)), near), far)
}
