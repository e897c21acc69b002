//! Random masters on random buses, against the model of `rulings.rs`: answers are lost, late,
//! damaged and cut, switches are moved, nodes die, ports fail, and applications give arbitrary
//! orders. Then the faults end, and every stop has to be paid.

#[path = "random_orders.rs"]
mod random_orders;

use std::collections::VecDeque;

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Master, Mode, NodeId,
        board::{OneMotor, ThreeMotors},
        master::{Health, MasterConfig, Polling},
    },
    sim::Rng,
    time::{Duration, Instant, wire_time},
};

use crate::{
    kit::{Kit, Reply, Sent},
    rulings::{DeadMan, Node, Seen},
};

/// Steps with faults.
const STEPS: usize = 300;

/// Time in which a healthy bus has to pay all stops.
const RECOVERY: Duration = Duration::from_millis(500);

const US: fn(u32) -> Duration = Duration::from_micros;

/// Bytes on their way to the master.
struct Arrival {
    at: Instant,
    bytes: Vec<u8>,
    /// The answering node and the packet answered, if the bytes are a readable answer.
    answer: Option<(Reply, u64)>,
}

struct Episode<B: Kit> {
    rng: Rng,
    master: Master<B>,
    config: MasterConfig,
    nodes: Vec<Node>,
    dead_man: DeadMan,
    /// True state of each node: its mode, and whether it answers.
    modes: Vec<Mode>,
    alive: Vec<bool>,
    air: VecDeque<Arrival>,
    now: Instant,
    /// Time at which the line is free.
    line_free: Instant,
    /// Number of packets sent.
    number: u64,
    /// Number of positions measured; the rotation shared by all.
    count: i16,
    rotation: i16,
    is_well: bool,
    /// Occasionally the master is not called for up to an hour.
    is_lazy: bool,
    is_told: bool,
}

impl<B: Kit> Episode<B> {
    fn new(seed: u64, is_told: bool) -> Self {
        let mut rng = Rng::new(seed);
        let count = 1 + rng.below(3) as usize;
        let mut config = MasterConfig::direct();
        config.nodes = NodeId::ALL.into_iter().take(count).collect();
        config.polling = match rng.below(3) {
            0 => Polling::Fastest,
            1 => Polling::Every(US(rng.below(5000) as u32)),
            _ => Polling::Manual,
        };
        if rng.chance(0.3) {
            config.turnaround_gap = US(rng.below(200) as u32);
        }
        if rng.chance(0.3) {
            config.recovery_share_pct = [0, 1, 50, 100][rng.below(4) as usize];
        }
        if rng.chance(0.5) {
            config.dead_man = Some(US(rng.below(20_000) as u32));
        }
        if rng.chance(0.3) {
            config.attempts = rng.below(4) as u8;
        }
        config.removes_echo = rng.chance(0.3);
        // Some clocks are about to wrap.
        let start = if rng.chance(0.2) { u64::MAX - 50_000 } else { rng.below(1 << 40) };
        let now = Instant::from_micros(start);
        let mut master = Master::new(config, now);
        master.discover(now);
        let mode = |_| if rng.chance(0.5) { Mode::Velocity } else { Mode::Position };
        Self {
            modes: (0..count).map(mode).collect(),
            // Some positions are not a standstill when read as a speed.
            rotation: if rng.chance(0.3) { 12_300 } else { 3 },
            is_lazy: rng.chance(0.3),
            rng,
            master,
            config,
            nodes: (0..count).map(|_| Node::default()).collect(),
            dead_man: DeadMan { limit: config.dead_man, alive_at: now },
            alive: vec![true; count],
            air: VecDeque::new(),
            now,
            line_free: now,
            number: 0,
            count: 0,
            is_well: false,
            is_told,
        }
    }

    fn run(mut self) -> Result<(), String> {
        for _ in 0..STEPS {
            self.step()?;
        }
        self.is_well = true;
        self.alive.fill(true);
        let end = self.now + RECOVERY;
        while !self.master.stops_owed().is_empty() {
            self.step()?;
            if self.now > end {
                return Err(format!("not paid on a healthy bus: {:?}", self.master.stops_owed()));
            }
        }
        for (node, id) in self.nodes.iter().zip(NodeId::ALL) {
            let kept = self.master.set_point(id).is_some();
            if kept && !node.is_stopped() && node.aim.is_none() {
                return Err(format!("{id} keeps a set-point that is no longer in force"));
            }
        }
        Ok(())
    }

    fn tell(&self, line: impl FnOnce() -> String) {
        if self.is_told {
            println!("{:?} {}", self.now, line());
        }
    }

    /// Follows what the master reports about its nodes.
    fn follow(&mut self) -> Result<(), String> {
        for (node, id) in self.nodes.iter_mut().zip(NodeId::ALL) {
            let seen = Seen {
                mode: self.master.mode(id),
                is_owed: self.master.stops_owed().contains(id),
                is_in_doubt: self.master.is_mode_in_doubt(id),
                is_abnormal: self.master.health(id) == Some(Health::Abnormal),
            };
            node.follow(seen, self.now).map_err(|error| format!("{id}: {error}"))?;
        }
        Ok(())
    }

    fn step(&mut self) -> Result<(), String> {
        self.pass();
        self.deliver()?;
        let is_early = self.rng.chance(0.5);
        if is_early {
            self.order()?;
        }
        if self.master.poll_timeout().is_some_and(|at| self.now >= at) {
            self.master.handle_timeout(self.now);
            self.follow()?;
        }
        if !is_early {
            self.order()?;
        }
        if self.is_well || self.rng.chance(0.8) {
            while self.master.poll_event().is_some() {}
        }
        if !self.is_well && self.rng.chance(0.02) {
            let node = self.any_node();
            self.modes[node] = other(self.modes[node]);
            self.tell(|| format!("switch of {}: {}", node + 1, self.modes[node]));
        }
        if !self.is_well && self.rng.chance(0.02) {
            let node = self.any_node();
            self.alive[node] = !self.alive[node];
            self.tell(|| format!("node {} answers: {}", node + 1, self.alive[node]));
        }
        if self.send()? {
            self.rest()?;
        }
        let is_owed = !self.master.stops_owed().is_empty();
        match is_owed && self.master.poll_timeout().is_none() {
            true => Err("no deadline while stops are owed".into()),
            false => Ok(()),
        }
    }

    fn any_node(&mut self) -> usize {
        self.rng.below(self.nodes.len() as u64) as usize
    }

    /// Lets time pass, usually until something is due.
    fn pass(&mut self) {
        let arrival = self.air.iter().map(|it| it.at).min();
        let due = [self.master.poll_timeout(), arrival].into_iter().flatten().min();
        let span = match self.rng.below(if self.is_well { 6 } else { 10 }) {
            0..=5 => due.map_or(US(100), |at| at - self.now).min(US(1_000_000)),
            6 | 7 => US(self.rng.below(400) as u32),
            8 => US(self.rng.below(3000) as u32),
            _ if self.is_lazy && self.rng.chance(0.1) => US(self.rng.below(3_600_000_000) as u32),
            _ => US(self.rng.below(50) as u32),
        };
        self.now += span;
    }

    fn arrived(&mut self) -> Option<Arrival> {
        let now = self.now;
        self.air.front().is_some_and(|it| it.at <= now).then(|| self.air.pop_front())?
    }

    fn deliver(&mut self) -> Result<(), String> {
        self.air.make_contiguous().sort_by_key(|it| it.at);
        while let Some(it) = self.arrived() {
            if let Some((reply, number)) = it.answer {
                self.tell(|| format!("hears {reply:?}"));
                let node = &mut self.nodes[index(reply.node)];
                node.hear(reply.mode, reply.place, number, self.now);
            }
            self.master.handle_input(&it.bytes, self.now);
            self.follow()?;
        }
        Ok(())
    }

    /// Sends what is due; returns whether the port took all of it.
    fn send(&mut self) -> Result<bool, String> {
        let mut sent = 0;
        loop {
            let packet = self.master.poll_transmit(self.now).map(<[u8]>::to_vec);
            self.follow()?;
            let Some(packet) = packet else { break };
            sent += 1;
            if sent > 20 {
                return Err("it never stops sending".into());
            }
            if !self.send_packet(&packet)? {
                return Ok(false);
            }
        }
        if sent > 0 && !self.is_well && self.rng.chance(0.02) {
            self.tell(|| "not flushed".into());
            self.master.handle_unsent(Unsent::Unflushed, self.now);
            self.nodes.iter_mut().for_each(Node::unflushed);
            return Ok(false);
        }
        Ok(true)
    }

    /// Returns whether the port took it.
    fn send_packet(&mut self, packet: &[u8]) -> Result<bool, String> {
        let sent = Sent::read::<B>(packet);
        self.tell(|| format!("sends {sent:?}"));
        self.number += 1;
        self.dead_man.expire(&mut self.nodes, self.now);
        let node = &mut self.nodes[index(sent.node)];
        if let Some(write) = &sent.write {
            node.judge(write, B::ANSWERS_WRITE, self.now)
                .map_err(|error| format!("{}: {error}", sent.node))?;
        }
        let fate = if self.is_well { 2 } else { self.rng.below(60) };
        let unsent = match fate {
            0 => Some(Unsent::Untouched),
            1 => Some(Unsent::CutOff),
            _ => None,
        };
        if let Some(unsent) = unsent {
            self.tell(|| format!("{unsent:?}"));
            self.master.handle_unsent(unsent, self.now);
            return Ok(false);
        }
        if let Some(write) = &sent.write {
            node.sent(write, self.number);
        }
        if self.config.removes_echo {
            self.air.push_back(Arrival { at: self.now, bytes: packet.to_vec(), answer: None });
        }
        let end = self.line_free.max(self.now) + wire_time(packet.len(), self.config.baud);
        self.line_free = end;
        if sent.is_exchange::<B>() && self.alive[index(sent.node)] {
            self.answer(sent.node, end);
        }
        Ok(true)
    }

    /// A node answers the packet just sent, or something goes wrong.
    fn answer(&mut self, node: NodeId, end: Instant) {
        let mode = self.modes[index(node)];
        self.count = (self.count + 1) % 8000;
        let reply = Reply { node, mode, place: (self.count, self.rotation) };
        if mode == Mode::Position {
            self.nodes[index(node)].measure(reply.place, end);
        }
        let mut bytes = reply.bytes::<B>();
        let mut at = end + US(50) + wire_time(bytes.len(), self.config.baud);
        let mut answer = Some((reply, self.number));
        match if self.is_well { 5 } else { self.rng.below(27) } {
            0 => at += US(350 + self.rng.below(500) as u32),
            1 => at += US(450),
            2 => (bytes[3], answer) = (bytes[3] ^ 4, None),
            3 => {
                bytes.truncate(5);
                answer = None;
            }
            4 => return,
            _ => {}
        }
        self.air.push_back(Arrival { at, bytes, answer });
    }

    /// Nothing is left to do until a deadline in the future.
    fn rest(&mut self) -> Result<(), String> {
        let is_over = |it: &Self| it.master.poll_timeout().is_some_and(|at| at <= it.now);
        if is_over(self) {
            self.master.handle_timeout(self.now);
            self.follow()?;
            if self.master.poll_transmit(self.now).is_some() {
                return Err("it sends after it had nothing to send".into());
            }
            if is_over(self) && !self.air.iter().any(|it| it.at <= self.now) {
                return Err("its deadline has passed and nothing is due".into());
            }
        }
        Ok(())
    }
}

fn index(node: NodeId) -> usize {
    usize::from(node.get() - 1)
}

const fn other(mode: Mode) -> Mode {
    match mode {
        Mode::Velocity => Mode::Position,
        Mode::Position => Mode::Velocity,
    }
}

/// Runs these seeds; the first one that breaks a rule is reported in full.
fn play<B: Kit>(seeds: core::ops::Range<u64>) {
    for seed in seeds {
        if Episode::<B>::new(seed, false).run().is_err() {
            let it = Episode::<B>::new(seed, true);
            println!("{:?}", it.config);
            panic!("seed {seed}: {:?}", it.run());
        }
    }
}

#[test]
fn a_random_master_of_boards_with_one_motor_obeys_the_model() {
    play::<OneMotor>(0..400);
}

#[test]
fn a_random_master_of_boards_with_three_motors_obeys_the_model() {
    play::<ThreeMotors>(0..400);
}
