//! Properties of the motor bus roles under any faults of the line: no answer from another node or
//! to another request, no READ without an end. What is written is judged by the models and by the
//! fuzz target `session`.

use std::collections::VecDeque;

use axlewire::{
    endpoint::{Arrival, Endpoint},
    ikeya::{
        Master, Mode, NodeId, Position, Slave, Status,
        master::{Health, MasterConfig, MasterEvent},
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{Direction, Input, Line, Rng, Who},
    time::{Duration, Instant, wire_time},
};
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed},
};

/// A position node that counts: each answer contains its id and the number of READs it has
/// received.
struct Counting {
    slave: Slave,
    /// When each answer was sent, by its number.
    answered: Vec<Instant>,
    heard: u32,
}

impl Counting {
    fn new(node: NodeId, baud: u32) -> Self {
        let slave =
            Slave::new(node, Mode::Position, SlaveConfig::at(baud), Instant::from_micros(0));
        Self { slave, answered: vec![Instant::from_micros(0)], heard: 0 }
    }

    fn number(&mut self) {
        let reads = self.slave.statistics().reads;
        if reads != self.heard {
            self.heard = reads;
            let rotation = i16::from(self.slave.node().get());
            self.slave.set_position(Position::new(reads as i16, rotation));
        }
    }
}

impl Endpoint for Counting {
    type Event = SlaveEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.slave.handle_input(bytes, now);
        self.number();
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.slave.handle_timeout(now);
        self.number();
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let answer = self.slave.poll_transmit(now)?;
        self.answered.resize(self.heard as usize + 1, now);
        Some(answer)
    }

    fn poll_event(&mut self) -> Option<SlaveEvent> {
        self.slave.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.slave.poll_timeout()
    }
}

/// A master that remembers its request times, and gives occasional commands.
struct Watched {
    master: Master,
    rng: Rng,
    /// Time of each node's last request, and since when it has been asked without an answer.
    asked: [Option<Instant>; 8],
    open: [Option<Instant>; 8],
    longest: Duration,
    events: VecDeque<(MasterEvent, Option<Instant>)>,
}

fn index(node: NodeId) -> usize {
    usize::from(node.get() - 1)
}

impl Watched {
    fn new(config: MasterConfig, seed: u64) -> Self {
        let now = Instant::default();
        let mut master = Master::new(config, now);
        master.discover(now);
        Self {
            master,
            rng: Rng::new(seed),
            asked: [None; 8],
            open: [None; 8],
            longest: Duration::ZERO,
            events: VecDeque::new(),
        }
    }

    /// Takes the events as they happen, with the time of the request to which they belong.
    fn note(&mut self, now: Instant) {
        while let Some(event) = self.master.poll_event() {
            let node = match event {
                MasterEvent::Status { node, .. } | MasterEvent::ReadFailed { node, .. } => node,
                _ => NodeId::N1,
            };
            if matches!(event, MasterEvent::Status { .. } | MasterEvent::ReadFailed { .. }) {
                if let Some(since) = self.open[index(node)].take() {
                    self.longest = self.longest.max(now - since);
                }
            }
            self.events.push_back((event, self.asked[index(node)]));
        }
        if self.rng.chance(0.05) {
            let node = NodeId::ALL[self.rng.below(8) as usize];
            let target = Position::new(self.rng.below(8192) as i16, i16::from(node.get()) * 100);
            // Refused while it is not online.
            let _ = self.master.set_position(node, target, now);
        }
        if self.rng.chance(0.005) {
            let node = NodeId::ALL[self.rng.below(8) as usize];
            self.master.stop(node, now);
        }
    }
}

impl Endpoint for Watched {
    type Event = (MasterEvent, Option<Instant>);

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.master.handle_input(bytes, now);
        self.note(now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.master.handle_timeout(now);
        self.note(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let is_online = NodeId::ALL.map(|node| {
            matches!(self.master.health(node), Some(Health::Online | Health::Suspect(_)))
        });
        let bytes = self.master.poll_transmit(now)?;
        let node = usize::from(bytes[1]) - 1;
        if bytes[0] == 0xAA {
            self.asked[node] = Some(now);
            if is_online[node] && self.open[node].is_none() {
                self.open[node] = Some(now);
            }
        }
        Some(bytes)
    }

    fn poll_event(&mut self) -> Option<Self::Event> {
        self.events.pop_front()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.master.poll_timeout()
    }
}

/// The line's faults, and the duration of the run.
#[derive(Clone, Debug)]
struct Weather {
    seed: u64,
    baud: u32,
    nodes: Vec<NodeId>,
    /// Rates in millionths: wrong bits, lost, doubled and inserted bytes.
    rates: [u32; 4],
    stray: Option<u8>,
    delay_us: u32,
    jitter_us: u32,
    /// Nodes that are unplugged and plugged in again, in turns of 20 ms.
    loose: Vec<NodeId>,
    by_pieces: bool,
}

fn weather() -> impl Strategy<Value = Weather> {
    let node = prop::sample::select(NodeId::ALL.to_vec());
    (
        any::<u64>(),
        prop::sample::select(vec![57_600_u32, 500_000, 2_000_000]),
        prop::collection::btree_set(node.clone().prop_map(NodeId::get), 1..=8),
        [0..2000_u32, 0..3000_u32, 0..3000_u32, 0..3000_u32],
        prop::option::of(any::<u8>()),
        (0..250_u32, 0..150_u32),
        prop::collection::vec(node, 0..3),
        any::<bool>(),
    )
        .prop_map(
            |(seed, baud, nodes, rates, stray, (delay_us, jitter_us), loose, by_pieces)| {
                let nodes = nodes.into_iter().map(|id| NodeId::new(id).unwrap()).collect();
                Weather { seed, baud, nodes, rates, stray, delay_us, jitter_us, loose, by_pieces }
            },
        )
}

fn line(weather: &Weather) -> Line<Watched, Counting> {
    let mut config = MasterConfig::direct();
    config.baud = weather.baud;
    if weather.by_pieces {
        // Bytes that come in pieces come later, by the pause that ends a piece.
        config.reply_timeout = config.reply_timeout.saturating_add(wire_time(2, weather.baud));
    }
    let mut line = Line::new(weather.baud, weather.seed, Watched::new(config, weather.seed));
    for &node in &weather.nodes {
        line.add(Counting::new(node, weather.baud));
    }
    let [bits, lost, doubled, inserted] = weather.rates.map(|rate| f64::from(rate) / 1e6);
    for direction in [Direction::ToTails, Direction::ToHead] {
        let faults = line.pair_mut(direction);
        (faults.bit_errors, faults.lost) = (bits, lost);
        (faults.duplicated, faults.inserted) = (doubled, inserted);
        faults.stray = weather.stray;
    }
    // An answer is late by at most the window and the guard: a later one cannot be distinguished.
    let faults = line.pair_mut(Direction::ToHead);
    faults.delay = Duration::from_micros(weather.delay_us);
    faults.jitter = Duration::from_micros(weather.jitter_us);
    if weather.by_pieces {
        let pause = wire_time(2, weather.baud);
        line.timing_mut(Who::Head).input = Input::AfterPause { pause, at_most: 64 };
    }
    line
}

/// An event, and the time of its node's last request.
type Told = (MasterEvent, Option<Instant>);

/// Runs the line for 200 ms of its time, and returns what the master reported.
fn run(weather: &Weather) -> (Line<Watched, Counting>, Vec<Told>) {
    let mut line = line(weather);
    let mut events = vec![];
    for turn in 0..10 {
        for loose in &weather.loose {
            if let Some(tail) = weather.nodes.iter().position(|node| node == loose) {
                line.stub_mut(Who::Tail(tail)).unplugged = turn % 2 == 1;
            }
        }
        line.run_for(Duration::from_millis(20)).expect("no role spins");
        events.extend(line.take_head_events().into_iter().map(|(_, event)| event));
    }
    (line, events)
}

proptest! {
    #![proptest_config(Config { cases: 60, rng_seed: RngSeed::Fixed(0xA71E), ..Config::default() })]

    #[test]
    fn no_answer_is_taken_from_another_node_or_another_request(weather in weather()) {
        let (line, events) = run(&weather);
        for (event, asked) in events {
            let MasterEvent::Status { node, status } = event else { continue };
            let Status::Position(at) = status else { panic!("a velocity from a position node") };
            prop_assert_eq!(at.rotation(), i16::from(node.get()), "another node's answer");
            let tail = weather.nodes.iter().position(|id| *id == node).expect("a node that exists");
            let answered = line.tail(tail).answered[at.count() as usize];
            prop_assert!(answered >= asked.expect("a request"), "an answer from before the request");
        }
    }

    #[test]
    fn every_read_ends_in_an_answer_or_a_counted_failure_within_its_bound(weather in weather()) {
        let (line, events) = run(&weather);
        let master = &line.head().master;
        for node in NodeId::ALL {
            let counts = master.node_statistics(node);
            let closed = counts.replies + counts.timeouts;
            prop_assert!(closed <= counts.requests, "{node}: {counts:?}");
            // An answer that puts the mode in doubt closes its window as well.
            prop_assert!(counts.requests <= closed + counts.other_mode + 1, "{node}: {counts:?}");
        }
        prop_assert!(line.head().longest <= master.read_bound(), "{:?}", line.head().longest);
        // The clean cases are not empty.
        if weather.rates[0] < 500 && weather.loose.is_empty() {
            let answers = events.iter().filter(|(event, _)| matches!(event, MasterEvent::Status { .. }));
            prop_assert!(answers.count() > 5);
        }
    }
}
