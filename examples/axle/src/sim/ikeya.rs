//! Motors on a bus.

use std::fmt;

use axlewire::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit},
    ikeya::{
        Mode, NodeId, Slave, Status, Target,
        board::{OneMotor, ThreeMotors},
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{Motor, MotorBoard, MotorNode},
    time::{Duration, Instant},
};
use serde::Serialize;

use super::stage::{Stage, StageArgs};
use crate::{
    args,
    boards::{Boards, Data, Values},
    failure::Failure,
    help::EXIT_CODES,
    session::Session,
};

/// Arguments of a simulated bus.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(super) struct Args {
    /// A node and its mode, such as 1:velocity or 3:position; repeat it for each node
    #[arg(short, long = "node", value_name = "N:MODE", required = true, value_parser = node)]
    nodes: Vec<(NodeId, Mode)>,

    /// Stop a motor that gets no command for this long; by default it keeps turning, as the
    /// protocol specifies
    #[arg(long, value_name = "SECONDS", value_parser = args::seconds)]
    watchdog: Option<u64>,

    /// A node that hears and obeys, but whose answers are lost; repeat it for each such node
    #[arg(long, value_name = "N", value_parser = args::node)]
    dead: Vec<NodeId>,

    #[command(flatten)]
    stage: StageArgs,
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

/// Boards that can be simulated and printed.
pub(super) trait Simulated: Boards + MotorBoard {
    /// Its motors, all alike.
    fn motors(motor: Motor) -> Self::Motor;

    /// Speeds and positions of its motors.
    fn state(motors: &Self::Motor) -> [Status<Self>; 2];
}

impl Simulated for OneMotor {
    fn motors(motor: Motor) -> Motor {
        motor
    }

    fn state(motor: &Motor) -> [Status; 2] {
        [Status::Velocity(motor.velocity().get()), Status::Position(motor.position())]
    }
}

impl Simulated for ThreeMotors {
    fn motors(motor: Motor) -> [Motor; 3] {
        [motor.clone(), motor.clone(), motor]
    }

    fn state(motors: &[Motor; 3]) -> [Status<Self>; 2] {
        let motors = motors.each_ref();
        let speeds = motors.map(|motor| motor.velocity().get());
        [Status::Velocity(speeds), Status::Position(motors.map(Motor::position))]
    }
}

/// Runs the subcommand.
pub(super) fn run<B: Simulated>(args: &Args) -> Result<(), Failure> {
    let mut nodes = Nodes::<B> { all: Vec::new(), sender: 0 };
    for &(node, mode) in &args.nodes {
        if nodes.all.iter().any(|other| other.id() == node) {
            return Err(Failure::Usage(format!("node {node} is given twice")));
        }
        nodes.all.push(Node::new(node, mode, args));
    }
    if let Some(dead) = args.dead.iter().find(|dead| !nodes.all.iter().any(|it| it.id() == **dead))
    {
        return Err(Failure::Usage(format!("--dead {dead}: there is no such --node")));
    }
    let (mut stage, line) = Stage::open(&args.stage)?;
    let mut session = Session::new(line, |_| nodes);
    while stage.goes_on(session.now())? {
        let until = session.now() + STEP;
        let mut told = session.round(until)?;
        let now = session.now();
        while let Some(event) = told {
            stage.say(now, &event)?;
            told = session.poll_event();
        }
        session.role_mut().handle_input(&[], now);
        for node in &mut session.role_mut().all {
            if let Some(event) = node.arrival() {
                stage.say(now, &event)?;
            }
        }
    }
    let now = session.now();
    for node in &session.role().all {
        let seen = node.motor.slave().statistics();
        let (reads, writes, answers) = (seen.reads, seen.writes, seen.replies);
        stage.say(now, &Event::Statistics { node: node.id(), reads, writes, answers })?;
    }
    Ok(())
}

/// What happens to a node.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    Command {
        node: NodeId,
        #[serde(flatten)]
        target: Data,
    },
    Watchdog {
        node: NodeId,
    },
    Turning {
        node: NodeId,
        #[serde(flatten)]
        speed: Data,
    },
    AtRest {
        node: NodeId,
        #[serde(flatten)]
        position: Data,
    },
    Statistics {
        node: NodeId,
        reads: u32,
        writes: u32,
        answers: u32,
    },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command { node, target } => write!(f, "node {node}: command {target}"),
            Self::Watchdog { node } => write!(f, "node {node}: watchdog, no more commands"),
            Self::Turning { node, speed } => write!(f, "node {node}: turning at {speed}"),
            Self::AtRest { node, position } => write!(f, "node {node}: at rest at {position}"),
            Self::Statistics { node, reads, writes, answers } => {
                write!(f, "node {node}: {reads} READ, {writes} WRITE, {answers} answers")
            }
        }
    }
}

/// A node, and what has been printed about it.
struct Node<B: Simulated> {
    motor: MotorNode<B>,
    /// Its answers are lost.
    is_dead: bool,
    /// The last printed command.
    told: Option<Target<B>>,
    /// Whether a motor has not yet reached its target.
    is_under_way: bool,
}

impl<B: Simulated> Node<B> {
    fn new(node: NodeId, mode: Mode, args: &Args) -> Self {
        let mut config = SlaveConfig::usb_adapter();
        config.watchdog = args
            .watchdog
            .map(|micros| Duration::from_micros(micros.try_into().unwrap_or(u32::MAX)));
        let slave = Slave::for_board(node, mode, config, Instant::from_micros(0));
        let motors = B::motors(Motor::new().with_time_constant(TIME_CONSTANT));
        Self {
            motor: MotorNode::from_parts(slave, motors),
            is_dead: args.dead.contains(&node),
            told: None,
            is_under_way: false,
        }
    }

    const fn id(&self) -> NodeId {
        self.motor.slave().node()
    }

    /// Each new command; masters repeat commands many times a second.
    fn describe(&mut self, event: SlaveEvent<B>) -> Option<Event> {
        let node = self.id();
        let told = match event {
            SlaveEvent::Command(target) => Some(target),
            _ => None,
        };
        if told.is_some() && told == self.told {
            return None;
        }
        (self.told, self.is_under_way) = (told, true);
        Some(match told {
            Some(target) => Event::Command { node, target: B::data(B::reached(target)) },
            None => Event::Watchdog { node },
        })
    }

    /// When the motors have reached their targets.
    fn arrival(&mut self) -> Option<Event> {
        let [speed, position] = B::state(self.motor.motor());
        let targets = match self.told {
            Some(target) => B::values(B::reached(target)),
            None => Values::Rps(vec![0.0; B::MOTORS]),
        };
        let (is_there, turns) = match (&targets, B::values(speed), B::values(position)) {
            (Values::Rps(targets), Values::Rps(now), _) => (
                targets.iter().zip(&now).all(|(target, now)| (now - target).abs() < STILL_RPS),
                targets.iter().any(|target| target.abs() >= STILL_RPS),
            ),
            (targets, _, now) => (*targets == now, false),
        };
        if !self.is_under_way || !is_there {
            return None;
        }
        self.is_under_way = false;
        let node = self.id();
        Some(match turns {
            true => Event::Turning { node, speed: B::data(speed) },
            false => Event::AtRest { node, position: B::data(position) },
        })
    }
}

/// All nodes receive every byte, and each sends its own answers.
struct Nodes<B: Simulated> {
    all: Vec<Node<B>>,
    /// The node that sent last.
    sender: usize,
}

impl<B: Simulated> Endpoint for Nodes<B> {
    type Event = Event;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        self.all.iter_mut().for_each(|node| node.motor.handle_input(bytes, arrived));
    }

    /// All nodes have the same settings.
    fn line_rules(&self) -> LineRules {
        self.all.first().map_or_else(LineRules::default, |node| node.motor.line_rules())
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.all.iter_mut().for_each(|node| node.motor.handle_timeout(now));
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        for (at, node) in self.all.iter_mut().enumerate() {
            if node.is_dead {
                while node.motor.poll_transmit(now).is_some() {}
                continue;
            }
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

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        if let Some(node) = self.all.get_mut(self.sender) {
            node.motor.handle_transmit(outcome, now);
        }
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.all.iter_mut().find_map(|node| {
            let event = node.motor.poll_event()?;
            node.describe(event)
        })
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.all.iter().filter_map(|node| node.motor.poll_timeout()).min()
    }
}

#[cfg(test)]
mod tests;
