//! An episode on a bus, direct or behind a USB adapter: one to eight motors, of which the master
//! does not know how many there are, a plug that may be loose, and a stop.

use axlewire::{
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave, Target,
        master::{MasterConfig, Polling, StopProgress},
        slave::SlaveConfig,
    },
    sim::{Input, Motor, MotorNode},
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
    is_adapter: bool,
    nodes: Vec<Present>,
}

/// A node that is on the bus. The others are silent, but the master does not know that.
struct Present {
    node: NodeId,
    mode: Mode,
    /// Its set-point.
    target: Option<Target>,
}

impl Episode {
    fn new(seed: u64, rng: &mut Rng) -> Self {
        let mut ids = NodeId::ALL;
        for last in (1..8).rev() {
            ids.swap(last, rng.below(last as u64 + 1) as usize);
        }
        let nodes = ids.into_iter().take(1 + rng.below(8) as usize).map(|node| Present {
            node,
            mode: if rng.chance(0.5) { Mode::Velocity } else { Mode::Position },
            target: None,
        });
        let nodes: Vec<_> = nodes.collect();
        let is_adapter = rng.chance(0.5);
        let mut config =
            if is_adapter { MasterConfig::usb_adapter() } else { MasterConfig::direct() };
        config.polling = match rng.below(3) {
            0 => Polling::Fastest,
            1 => Polling::Every(Duration::from_millis(5)),
            _ => Polling::Manual,
        };
        let mut bus = Bus::new(500_000, seed, Master::new(config, Instant::from_micros(0)));
        for &Present { node, mode, .. } in &nodes {
            let slave = Slave::new(node, mode, SlaveConfig::direct(), Instant::from_micros(0));
            let motor = Motor::new()
                .with_time_constant(TIME_CONSTANT)
                .with_speed_limit(Rps::new(POSITION_RPS as f32).unwrap());
            let tail = bus.add(MotorNode::from_parts(slave, motor));
            bus.timing_mut(Who::Tail(tail)).latency = Duration::from_micros(rng.below(50) as u32);
        }
        // An answer is never later than the 500 us that the master waits: 4 times 60, 50 and 150.
        let noise = rng.below(3);
        for direction in [Direction::ToTails, Direction::ToHead] {
            let faults = faults(rng, 60);
            let (delay, jitter) = (faults.delay, faults.jitter);
            let pair = bus.pair_mut(direction);
            (*pair, pair.delay, pair.jitter) = match noise {
                0 => (Faults::CLEAN, delay, jitter),
                1 => (Faults::noise(1e-3), delay, jitter),
                _ => (faults, delay, jitter),
            };
        }
        bus.timing_mut(Who::Head).latency = Duration::from_micros(rng.below(150) as u32);
        if is_adapter {
            let wait = Duration::from_micros(rng.below(16_001) as u32);
            bus.timing_mut(Who::Head).input = Input::AfterFirst { wait, at_most: 62 };
        }
        Self { bus, is_adapter, nodes }
    }

    /// Discovers the nodes through the noise.
    fn discover(&mut self) {
        while self.nodes.iter().any(|it| self.bus.head().mode(it.node).is_none()) {
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
        for it in &mut self.nodes {
            let way = (2.0 * part(rng) - 1.0) * FASTEST_RPS;
            let master = self.bus.head_mut();
            let (target, given) = match it.mode {
                Mode::Velocity => {
                    let rps = Rps::new(way as f32).unwrap();
                    (Target::Velocity(rps), master.set_velocity(it.node, rps, now))
                }
                Mode::Position => {
                    let to = Position::from_revolutions(way * 10.0).unwrap();
                    (Target::Position(to), master.set_position(it.node, to, now))
                }
            };
            it.target = given.is_ok().then_some(target);
        }
    }

    /// Whether a node is under its set-point, and not there yet.
    fn is_commanded(&self, tail: usize) -> bool {
        let command = self.bus.tail(tail).slave().command(self.bus.now());
        match command {
            None => false,
            Some(Target::Velocity(speed)) => speed.get().abs() >= 0.05,
            Some(Target::Position(to)) => {
                command == self.nodes[tail].target && to != self.motor(tail).position()
            }
        }
    }

    /// Time in which the search finds each of these nodes again: two windows for each, as much for
    /// the nodes that answer in between, four for what is in progress, and 4 ms for silent WRITEs
    /// in between and for the look once a millisecond.
    fn search_ms(&self, silent: usize) -> f64 {
        let window_ms = if self.is_adapter { 20.4 } else { 0.8 };
        4.0 * window_ms * (silent + 1) as f64 + 4.0
    }

    /// Number of bytes that it and the master could not read.
    fn damage(&self, tail: usize) -> u64 {
        let master = self.bus.head().counters();
        self.bus.tail(tail).slave().counters().skipped() + master.skipped()
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

    // A cable to some of the nodes that falls out before, at or after the stop, and is plugged in
    // again.
    let share = if rng.chance(0.5) { 0.0 } else { part(&mut rng) };
    let loose: Vec<bool> = episode.nodes.iter().map(|_| rng.chance(share)).collect();
    let out_at = episode.bus.now() + millis(&mut rng, 0, 60);
    let in_at = out_at + millis(&mut rng, 0, 300);
    let stop_at = episode.bus.now() + millis(&mut rng, 0, 100);

    let bound = episode.bus.head().stop_bound();
    let end = stop_at.max(in_at) + bound + Duration::from_millis(600);
    let mut watches: Vec<Watch> = episode.nodes.iter().map(|_| Watch::default()).collect();
    let (mut is_stopped, mut is_over) = (false, false);
    while !is_over && episode.bus.now() < end {
        let now = episode.bus.now();
        for (tail, _) in loose.iter().enumerate().filter(|(_, is_loose)| **is_loose) {
            episode.bus.stub_mut(Who::Tail(tail)).unplugged = (out_at..in_at).contains(&now);
        }
        if !is_stopped && now >= stop_at {
            is_stopped = true;
            episode.bus.head_mut().stop_all(now);
        }
        episode.pass(1);
        is_over = is_stopped && episode.bus.now() >= in_at;
        for (tail, watch) in watches.iter_mut().enumerate() {
            let progress = episode.bus.head().stop_progress(episode.nodes[tail].node);
            let is_still = progress == StopProgress::StandingStill;
            let is_commanded = episode.is_commanded(tail);
            watch.is_ok_wrong |= is_still && is_commanded;
            watch.has_stood |= is_still;
            let from = if loose[tail] { stop_at.max(in_at) } else { stop_at };
            watch.look(episode.motor(tail), episode.bus.now(), from);
            if loose[tail] && is_stopped && stop_at <= in_at && episode.bus.now() >= in_at {
                watch.back(is_commanded, episode.damage(tail), episode.bus.now() - in_at);
            }
            is_over &= is_still && episode.motor(tail).velocity().get().abs() < 0.05;
        }
    }
    let silent = loose.iter().filter(|is_loose| **is_loose).count();
    let bound_ms = f64::from(bound.as_micros()) / 1e3;
    let runs = episode.nodes.iter().zip(&watches).map(|(&Present { node, mode, .. }, watch)| {
        let back_ms = match mode {
            Mode::Velocity => 50.0,
            Mode::Position => episode.search_ms(silent),
        };
        let cable = watch.damage.map(|(before, after)| {
            let is_damaged = before != after;
            let bound_ms = if is_damaged { bound_ms + back_ms } else { back_ms };
            Cable { time_ms: watch.back_ms, bound_ms, is_damaged }
        });
        let bound_ms = bound_ms + cable.map_or(0.0, |_| back_ms);
        // A node that has since become abnormal is owed another stop.
        let progress = episode.bus.head().stop_progress(node);
        let is_good = watch.has_stood && progress != StopProgress::NotAsked;
        let complaint = (!is_good).then(|| format!("node {node} is {progress:?} at the end"));
        let kind = match (episode.is_adapter, mode) {
            (false, Mode::Velocity) => "bus, velocity",
            (false, Mode::Position) => "bus, position",
            (true, Mode::Velocity) => "adapter, velocity",
            (true, Mode::Position) => "adapter, position",
        };
        let (time_bound_ms, fastest) = match mode {
            Mode::Velocity => (bound_ms + RUN_OUT_MS, FASTEST_RPS),
            Mode::Position => (bound_ms, POSITION_RPS),
        };
        Run {
            kind,
            seed,
            time_ms: watch.time_ms,
            time_bound_ms,
            way: watch.way,
            way_bound: fastest * (bound_ms + f64::from(TIME_CONSTANT.as_micros()) / 1e3) / 1e3,
            unit: "turns",
            cable,
            is_ok_wrong: watch.is_ok_wrong,
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
    /// It was wrong about that.
    is_ok_wrong: bool,
    /// What was damaged before the cable came back, and before the stop arrived; and when that
    /// was, in ms, if the node was under a set-point until then.
    damage: Option<(u64, u64)>,
    back_ms: f64,
    is_back: bool,
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

    /// The cable has been back for so long.
    fn back(&mut self, is_commanded: bool, damage: u64, since: Duration) {
        if !self.is_back && (is_commanded || self.damage.is_some()) {
            let before = self.damage.map_or(damage, |(before, _)| before);
            self.damage = Some((before, damage));
            self.back_ms = f64::from(since.as_micros()) / 1e3;
        }
        self.is_back |= !is_commanded;
    }
}
