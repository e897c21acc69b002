//! Eight motors on a bus: all are driven while one thing after another goes wrong, and are stopped.

use std::error::Error;

use axlewire::{
    crc16,
    endpoint::{Arrival, Endpoint},
    ikeya::{
        BAUD, BothDirections, Master, Mode, NodeId, Position, Rps, Slave,
        board::{OneMotor, Target},
        master::{MasterConfig, Polling},
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{Line, Motor, MotorNode, Who},
    time::{Duration, Instant},
};

use crate::capture::{self, Described};

type Bus = Line<Master, Driver>;

/// Each node is read this often: a faster bus would make the capture larger.
const CYCLE: Duration = Duration::from_millis(130);

/// The application gives its set-points this often.
const STEP_MS: u32 = 20;
const STEPS: u32 = 10_400 / STEP_MS;

/// Runs the story; returns the capture.
pub(crate) fn story() -> Result<Vec<u8>, Box<dyn Error>> {
    let mut bus = bus()?;
    let now = bus.now();
    bus.head_mut().discover(now);
    for step in 0..STEPS {
        let millis = step * STEP_MS;
        happen(&mut bus, millis)?;
        let now = bus.now();
        let master = bus.head_mut();
        match millis {
            400..9000 if millis.is_multiple_of(200) => command(master, millis, now)?,
            9000 => master.stop_all(now),
            _ => {}
        }
        // A node that is made late takes some time of the steps behind it.
        let end = Instant::from_millis((millis + STEP_MS).into());
        let left = end - bus.now();
        bus.run_for(if bus.now() < end { left } else { Duration::ZERO })?;
    }
    let described =
        Described { link_type: 147, protocol: "ikeya", name: "simulated bus", baud: BAUD };
    Ok(capture::file::<BothDirections>(&described, bus.trace()))
}

/// Nodes 1 to 4 turn, 5 to 8 move to positions.
fn bus() -> Result<Bus, Box<dyn Error>> {
    let begin = Instant::from_micros(0);
    let mut config = MasterConfig::direct();
    config.polling = Polling::Every(CYCLE);
    config.recovery_share_pct = 1;
    // An idle line searches for a silent node all the time; less often makes the capture smaller.
    config.late_guard = Duration::from_millis(20);
    let mut bus = Bus::new(BAUD, 2026, Master::new(config, begin));
    for node in NodeId::ALL {
        let mode = if node <= NodeId::N4 { Mode::Velocity } else { Mode::Position };
        let slave = Slave::new(node, mode, SlaveConfig::direct(), begin);
        let motor = Motor::new()
            .with_time_constant(Duration::from_millis(250))
            .with_speed_limit(Rps::new(1.5)?);
        let tail = bus.add(Driver {
            node: MotorNode::from_parts(slave, motor),
            has_fault: false,
            answer: Vec::new(),
        });
        // No two boards are equally fast.
        bus.timing_mut(Who::Tail(tail)).latency = Duration::from_micros(18 + 4 * tail as u32);
        bus.stub_mut(Who::Tail(tail)).jitter = Duration::from_micros(6);
    }
    bus.record();
    Ok(bus)
}

/// What goes wrong at this moment.
fn happen(bus: &mut Bus, millis: u32) -> Result<(), Box<dyn Error>> {
    match millis {
        // Node 3 falls silent, and turns on with its last command, as no slave here has a watchdog.
        2000 => bus.stub_mut(tail(NodeId::N3)).unplugged = true,
        3200 => bus.stub_mut(tail(NodeId::N3)).unplugged = false,
        // A welder nearby.
        4400 => welder(bus, 1.0),
        5000 => welder(bus, 0.0),
        // Node 6 answers late, once.
        5600 => late(bus, NodeId::N6)?,
        // A board with a wrong DIP switch announces itself as node 9.
        6200 => bus.inject(tail(NodeId::N8), &velocity_of(9, 0.0)),
        // The driver of node 4 has a fault for a second: it does not turn, and does not measure.
        7000 => bus.tail_mut(3).has_fault = true,
        8000 => bus.tail_mut(3).has_fault = false,
        _ => {}
    }
    Ok(())
}

fn tail(node: NodeId) -> Who {
    Who::Tail(usize::from(node.get()) - 1)
}

/// Noise at every board: what it hears and what it sends is damaged. The requests in the recording
/// are intact, because the master makes it.
fn welder(bus: &mut Bus, strength: f64) {
    for node in NodeId::ALL {
        let stub = bus.stub_mut(tail(node));
        (stub.bit_errors, stub.lost) = (0.006 * strength, 0.01 * strength);
        stub.inserted = 0.02 * strength;
    }
}

/// Slows a node down until the master has missed one answer of it.
fn late(bus: &mut Bus, node: NodeId) -> Result<(), Box<dyn Error>> {
    let missed = bus.head().node_statistics(node).timeouts;
    bus.stub_mut(tail(node)).delay = Duration::from_micros(350);
    let end = bus.now() + CYCLE + CYCLE;
    while bus.head().node_statistics(node).timeouts == missed && bus.now() < end {
        bus.run_for(Duration::from_micros(50))?;
    }
    bus.stub_mut(tail(node)).delay = Duration::ZERO;
    Ok(())
}

/// Gives every node that may be driven its set-point.
fn command(master: &mut Master, millis: u32, now: Instant) -> Result<(), Box<dyn Error>> {
    for node in NodeId::ALL {
        let target = target(node, f64::from(millis - 400) / 1000.0)?;
        // Somebody looks at node 3 before it is driven again.
        let is_inspected = node == NodeId::N3 && (2000..4000).contains(&millis);
        // Not those that are silent, or that are owed a stop.
        if is_inspected || master.check(node, &target).is_err() {
            continue;
        }
        match target {
            Target::Velocity(target) => master.set_velocity(node, target, now)?,
            Target::Position(target) => master.set_position(node, target, now)?,
        }
    }
    Ok(())
}

/// Where a node should be, or how fast, after this time.
fn target(node: NodeId, seconds: f64) -> Result<Target<OneMotor>, Box<dyn Error>> {
    let turn = |rps: f64| Ok(Target::Velocity(Rps::new(rps as f32)?));
    let go_to = |revolutions: f64| Ok(Target::Position(Position::from_revolutions(revolutions)?));
    // From 0 up to 1, down to -1 and back in this period.
    let wave = |period: f64| 1.0 - 4.0 * ((seconds / period + 0.25).fract() - 0.5).abs();
    match node {
        NodeId::N1 => turn(2.0 * wave(4.0)),
        NodeId::N2 => turn(if seconds % 3.0 < 1.5 { 1.0 } else { -1.0 }),
        NodeId::N3 => turn(1.5),
        NodeId::N4 => turn(0.5 * seconds.floor().min(5.0)),
        NodeId::N5 => go_to(if seconds % 4.0 < 2.0 { 2.0 } else { 0.0 }),
        NodeId::N6 => go_to(1.5 * wave(6.0)),
        NodeId::N7 => go_to(-seconds.floor() / 2.0),
        NodeId::N8 => go_to(seconds / 2.0),
    }
}

/// A motor's driver, which can have a fault: then the motor coasts, and its speed is not a number.
#[derive(Debug)]
struct Driver {
    node: MotorNode,
    has_fault: bool,
    /// The answer of the fault.
    answer: Vec<u8>,
}

impl Driver {
    /// Undoes what the node has just told the motor.
    fn coast(&mut self) {
        if self.has_fault {
            self.node.motor_mut().turn(Rps::ZERO);
        }
    }
}

impl Endpoint for Driver {
    type Event = SlaveEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.node.handle_input(bytes, now);
        self.coast();
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.node.handle_timeout(now);
        self.coast();
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let id = self.node.slave().node().get();
        let answer = self.node.poll_transmit(now)?;
        if !self.has_fault {
            return Some(answer);
        }
        self.answer = velocity_of(id, f32::NAN).into();
        Some(&self.answer)
    }

    fn poll_event(&mut self) -> Option<SlaveEvent> {
        self.node.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.node.poll_timeout()
    }
}

/// An answer that the types of the library refuse to build: of any id, and any number.
fn velocity_of(id: u8, rps: f32) -> [u8; 8] {
    let [a, b, c, d] = rps.to_le_bytes();
    let [low, high] = crc16::compute(&[0x55, id, a, b, c, d]).to_le_bytes();
    [0x55, id, a, b, c, d, low, high]
}
