//! Motors on a bus.

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Mode, NodeId, Slave, Target,
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{Motor, MotorNode},
    time::{Duration, Instant},
};

use super::{Faults, pty::Pty, say};
use crate::{EXIT_CODES, args, failure::Failure, session::Session, signals::Signals};

/// Simulate motors on a bus, which answer and turn as commanded
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(super) struct Args {
    /// A node and its mode, such as 1:velocity or 3:position; repeat it for each node
    #[arg(long = "node", value_name = "N:MODE", required = true, value_parser = node)]
    nodes: Vec<(NodeId, Mode)>,

    /// Stop a motor that gets no command for this long; by default it keeps turning, as the
    /// protocol specifies
    #[arg(long, value_name = "SECONDS", value_parser = args::seconds)]
    watchdog: Option<u64>,

    #[command(flatten)]
    faults: Faults,
}

fn node(text: &str) -> Result<(NodeId, Mode), String> {
    let (node, mode) =
        text.split_once(':').ok_or("expected N:MODE, as in 1:velocity".to_owned())?;
    let mode = match mode {
        "velocity" => Mode::Velocity,
        "position" => Mode::Position,
        _ => return Err("the mode must be velocity or position".to_owned()),
    };
    Ok((args::node(node)?, mode))
}

/// Time to reach 63 % of a new speed: slow enough to watch.
const TIME_CONSTANT: Duration = Duration::from_millis(150);

/// Speeds below this count as rest; speeds this close to the target count as reached.
const STILL_RPS: f32 = 0.005;

/// Interval between two checks of the motors.
const STEP: Duration = Duration::from_millis(20);

/// Runs the subcommand.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut nodes = Nodes { all: Vec::new(), sender: 0 };
    for &(node, mode) in &args.nodes {
        if nodes.all.iter().any(|other| other.motor.slave().node() == node) {
            return Err(Failure::Usage(format!("node {node} is given twice")));
        }
        nodes.all.push(Node::new(node, mode, args.watchdog));
    }
    let signals = Signals::listen()?;
    let mut session = Session::new(Pty::open(args.faults)?, |_| nodes);
    while !signals.is_raised() {
        let until = session.now() + STEP;
        let mut told = session.round(until)?;
        let now = session.now();
        while let Some(line) = told {
            say(now, &line)?;
            told = session.poll_event();
        }
        session.role_mut().handle_input(&[], now);
        for node in &mut session.role_mut().all {
            if let Some(line) = node.arrival() {
                say(now, &line)?;
            }
        }
    }
    let now = session.now();
    for node in &session.role().all {
        let slave = node.motor.slave();
        let (id, seen) = (slave.node(), slave.statistics());
        let line = format!(
            "node {id}: {} READ, {} WRITE, {} answers",
            seen.reads, seen.writes, seen.replies
        );
        say(now, &line)?;
    }
    Ok(())
}

/// A node, and what has been printed about it.
struct Node {
    motor: MotorNode,
    /// The last printed command.
    told: Option<Target>,
    /// Whether the motor has not yet reached its target.
    is_under_way: bool,
}

impl Node {
    fn new(node: NodeId, mode: Mode, watchdog: Option<u64>) -> Self {
        let mut config = SlaveConfig::usb_adapter();
        config.watchdog =
            watchdog.map(|micros| Duration::from_micros(micros.try_into().unwrap_or(u32::MAX)));
        let slave = Slave::new(node, mode, config, Instant::from_micros(0));
        let motor = Motor::new().with_time_constant(TIME_CONSTANT);
        Self { motor: MotorNode::from_parts(slave, motor), told: None, is_under_way: false }
    }

    /// A line for each new command; masters repeat commands many times a second.
    fn describe(&mut self, event: SlaveEvent) -> Option<String> {
        let node = self.motor.slave().node();
        let told = match event {
            SlaveEvent::Command(target) => Some(target),
            _ => None,
        };
        if told.is_some() && told == self.told {
            return None;
        }
        (self.told, self.is_under_way) = (told, true);
        Some(match told {
            Some(Target::Velocity(rps)) => format!("node {node}: command {:.2} rps", rps.get()),
            Some(Target::Position(position)) => {
                format!("node {node}: command {:.4} turns", position.revolutions())
            }
            None => format!("node {node}: watchdog, no more commands"),
        })
    }

    /// A line when the motor has reached its target.
    fn arrival(&mut self) -> Option<String> {
        let (node, motor) = (self.motor.slave().node(), self.motor.motor());
        let (now, at) = (motor.velocity().get(), motor.position());
        let is_there = match self.told {
            Some(Target::Velocity(rps)) => (now - rps.get()).abs() < STILL_RPS,
            Some(Target::Position(position)) => at.counts() == position.counts(),
            None => now.abs() < STILL_RPS,
        };
        if !self.is_under_way || !is_there {
            return None;
        }
        self.is_under_way = false;
        Some(match self.told {
            Some(Target::Velocity(rps)) if rps.get().abs() >= STILL_RPS => {
                format!("node {node}: turning at {now:.2} rps")
            }
            _ => format!("node {node}: at rest at {:.4} turns", at.revolutions()),
        })
    }
}

/// All nodes receive every byte, and each sends its own answers.
struct Nodes {
    all: Vec<Node>,
    /// The node that sent last.
    sender: usize,
}

impl Endpoint for Nodes {
    type Event = String;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.all.iter_mut().for_each(|node| node.motor.handle_input(bytes, now));
    }

    fn handle_old_input(&mut self, bytes: &[u8], since: Instant, now: Instant) {
        self.all.iter_mut().for_each(|node| node.motor.handle_old_input(bytes, since, now));
    }

    fn held_up_after(&self) -> Option<Duration> {
        self.all.iter().filter_map(|node| node.motor.held_up_after()).min()
    }

    fn frame_pause(&self) -> Duration {
        let pauses = self.all.iter().map(|node| node.motor.frame_pause());
        pauses.min().unwrap_or(Duration::ZERO)
    }

    fn wire_time(&self, bytes: usize) -> Duration {
        self.all.first().map_or(Duration::ZERO, |node| node.motor.wire_time(bytes))
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.all.iter_mut().for_each(|node| node.motor.handle_timeout(now));
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        for (at, node) in self.all.iter_mut().enumerate() {
            if let Some(frame) = node.motor.poll_transmit(now) {
                self.sender = at;
                return Some(frame);
            }
        }
        None
    }

    fn is_outdated(&self) -> bool {
        self.all.get(self.sender).is_some_and(|node| node.motor.is_outdated())
    }

    fn handle_unsent(&mut self, unsent: Unsent, now: Instant) {
        if let Some(node) = self.all.get_mut(self.sender) {
            node.motor.handle_unsent(unsent, now);
        }
    }

    fn poll_event(&mut self) -> Option<String> {
        self.all.iter_mut().find_map(|node| {
            let event = node.motor.poll_event()?;
            node.describe(event)
        })
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.all.iter().filter_map(|node| node.motor.poll_timeout()).min()
    }
}
