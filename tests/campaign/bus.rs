//! An episode on a bus: up to three motors, a plug that may be loose, and a stop.

use axlewire::{
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave,
        master::{MasterConfig, Polling, StopProgress},
        slave::SlaveConfig,
    },
    sim::{Motor, MotorNode},
};

use super::*;

/// Highest commanded speed of a motor, and highest speed when moving to a position, rps.
const FASTEST_RPS: f64 = 10.0;
const POSITION_RPS: f64 = 5.0;

/// Time in which a motor loses 63 % of its speed.
const TIME_CONSTANT: Duration = Duration::from_millis(50);

/// Time to fall from full speed to standstill, 0.05 rps: ln(200) time constants.
const RUN_OUT_MS: f64 = 5.3 * 50.0;

type Bus = Line<Master, MotorNode>;

struct Episode {
    bus: Bus,
    nodes: Vec<(NodeId, Mode)>,
}

impl Episode {
    fn new(seed: u64, rng: &mut Rng) -> Self {
        let nodes: Vec<_> = NodeId::ALL
            .into_iter()
            .take(1 + rng.below(3) as usize)
            .map(|node| (node, if rng.chance(0.5) { Mode::Velocity } else { Mode::Position }))
            .collect();
        let mut config = MasterConfig::direct();
        config.nodes = nodes.iter().map(|(node, _)| *node).collect();
        config.polling = match rng.below(3) {
            0 => Polling::Fastest,
            1 => Polling::Every(Duration::from_millis(5)),
            _ => Polling::Manual,
        };
        let mut bus = Bus::new(500_000, seed, Master::new(config, Instant::from_micros(0)));
        for &(node, mode) in &nodes {
            let slave = Slave::new(node, mode, SlaveConfig::direct(), Instant::from_micros(0));
            let motor = Motor::new()
                .with_time_constant(TIME_CONSTANT)
                .with_speed_limit(Rps::new(POSITION_RPS as f32).unwrap());
            let tail = bus.add(MotorNode::from_parts(slave, motor));
            bus.timing_mut(Who::Tail(tail)).latency = Duration::from_micros(rng.below(50) as u32);
        }
        // An answer is never later than the 500 us that the master waits: 4 times 60, 50 and 150.
        *bus.pair_mut(Direction::ToTails) = faults(rng, 60);
        *bus.pair_mut(Direction::ToHead) = faults(rng, 60);
        bus.timing_mut(Who::Head).latency = Duration::from_micros(rng.below(150) as u32);
        Self { bus, nodes }
    }

    /// Discovers the nodes through the noise.
    fn discover(&mut self) {
        while self.nodes.iter().any(|(node, _)| self.bus.head().mode(*node).is_none()) {
            if !self.bus.head().is_discovering() {
                let now = self.bus.now();
                self.bus.head_mut().discover(now);
            }
            self.pass(1);
        }
    }

    fn pass(&mut self, millis: u32) {
        self.bus.run_for(Duration::from_millis(millis)).unwrap();
        // A motor is simulated up to the last call of its node, whether or not bytes arrived.
        let now = self.bus.now();
        for tail in 0..self.nodes.len() {
            self.bus.tail_mut(tail).handle_input(&[], now);
        }
        self.bus.take_head_events();
        self.bus.take_tail_events();
    }

    /// Starts all nodes. A command may be refused if a node has just missed three answers.
    fn command(&mut self, rng: &mut Rng) {
        let now = self.bus.now();
        for &(node, mode) in &self.nodes {
            let way = (2.0 * part(rng) - 1.0) * FASTEST_RPS;
            let master = self.bus.head_mut();
            let _ = match mode {
                Mode::Velocity => master.set_velocity(node, Rps::new(way as f32).unwrap(), now),
                Mode::Position => {
                    let target = Position::from_revolutions(way * 10.0).unwrap();
                    master.set_position(node, target, now)
                }
            };
        }
    }

    /// Requests the readings that show a standstill: with [`Polling::Manual`] nothing else does.
    fn read_stopped(&mut self) {
        let now = self.bus.now();
        for &(node, _) in &self.nodes {
            if self.bus.head().stop_progress(node) == StopProgress::Confirmed {
                // Refused while it is not online.
                let _ = self.bus.head_mut().read(node, now);
            }
        }
    }

    fn motor(&self, tail: usize) -> &Motor {
        self.bus.tail(tail).motor()
    }
}

pub(crate) fn episode(seed: u64) -> Vec<Run> {
    let mut rng = Rng::new(seed ^ 0xB005);
    let mut episode = Episode::new(seed, &mut rng);
    episode.discover();
    episode.command(&mut rng);
    episode.pass(1 + rng.below(200) as u32);

    // A plug that falls out before, at or after the stop, and is plugged in again.
    let loose = rng.chance(0.3).then(|| rng.below(episode.nodes.len() as u64) as usize);
    let out_at = episode.bus.now() + millis(&mut rng, 0, 60);
    let in_at = out_at + millis(&mut rng, 0, 300);
    let stop_at = episode.bus.now() + millis(&mut rng, 0, 100);

    let bound = episode.bus.head().stop_bound();
    let end = stop_at.max(in_at) + bound + Duration::from_millis(600);
    let mut watches: Vec<Watch> = episode.nodes.iter().map(|_| Watch::default()).collect();
    let mut is_stopped = false;
    while episode.bus.now() < end {
        let now = episode.bus.now();
        if let Some(tail) = loose {
            episode.bus.stub_mut(Who::Tail(tail)).unplugged = (out_at..in_at).contains(&now);
        }
        if !is_stopped && now >= stop_at {
            is_stopped = true;
            episode.bus.head_mut().stop_all(now);
        }
        if is_stopped {
            episode.read_stopped();
        }
        episode.pass(1);
        for (tail, watch) in watches.iter_mut().enumerate() {
            let progress = episode.bus.head().stop_progress(episode.nodes[tail].0);
            watch.has_stood |= progress == StopProgress::StandingStill;
            let from = if loose == Some(tail) { stop_at.max(in_at) } else { stop_at };
            watch.look(episode.motor(tail), episode.bus.now(), from);
        }
    }
    let bound_ms = f64::from(bound.as_micros()) / 1e3;
    let runs = episode.nodes.iter().zip(&watches).map(|(&(node, mode), watch)| {
        // A node that has since become abnormal is owed another stop.
        let progress = episode.bus.head().stop_progress(node);
        let is_good = watch.has_stood && progress != StopProgress::NotAsked;
        let complaint = (!is_good).then(|| format!("node {node} is {progress:?} at the end"));
        let (kind, time_bound_ms, fastest) = match mode {
            Mode::Velocity => ("bus, velocity", bound_ms + RUN_OUT_MS, FASTEST_RPS),
            Mode::Position => ("bus, position", bound_ms, POSITION_RPS),
        };
        Run {
            kind,
            seed,
            time_ms: watch.time_ms,
            time_bound_ms,
            way: watch.way,
            way_bound: fastest * (bound_ms + f64::from(TIME_CONSTANT.as_micros()) / 1e3) / 1e3,
            unit: "turns",
            complaint,
        }
    });
    runs.collect()
}

/// How long and how far a motor still moves.
#[derive(Default)]
struct Watch {
    start: Option<f64>,
    time_ms: f64,
    way: f64,
    /// The master has seen it at standstill.
    has_stood: bool,
}

impl Watch {
    fn look(&mut self, motor: &Motor, now: Instant, from: Instant) {
        if now < from {
            return;
        }
        let here = motor.position().revolutions();
        let start = *self.start.get_or_insert(here);
        self.way = self.way.max((here - start).abs());
        if motor.velocity().get().abs() >= 0.05 {
            self.time_ms = f64::from((now - from).as_micros()) / 1e3;
        }
    }
}
