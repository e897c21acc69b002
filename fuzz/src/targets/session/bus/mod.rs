//! A session of a motor bus: a master and up to three slaves.

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position,
        master::{MasterConfig, Polling},
        slave::SlaveConfig,
    },
    stream::Echo,
    time::{Duration, Instant},
};

mod actions;
mod end;
mod master;

use super::{ACTIONS, Tally, ears::Ears, oracle::Rules, station::Station, way::Way};
use crate::{
    kit::{Kit, Reply},
    rulings::{DeadMan, Node},
};

#[derive(Arbitrary, Clone, Copy, Debug)]
struct Setup {
    nodes: u8,
    modes: u8,
    start: u8,
    polling: u8,
    attempts: u8,
    gap_us: u8,
    share: u8,
    dead_man_ms: Option<u8>,
    has_echo: bool,
    knows_nodes: bool,
    has_watchdog: bool,
    is_far: bool,
}

const US: fn(u32) -> Duration = Duration::from_micros;

pub(super) struct Session<B: Kit> {
    pub(super) now: Instant,
    pub(super) master: Master<B>,
    config: MasterConfig,
    pub(super) model: Vec<Node>,
    dead_man: DeadMan,
    pub(super) stations: Vec<Station<B>>,
    to_master: Way,
    to_slaves: Way,
    /// What the master's adapter hears of itself, if it does.
    echo: Option<Echo>,
    ears: Ears,
    /// Answers that the master has received but not yet taken, and those under way.
    unheard: Vec<(Reply, u64)>,
    answers: Vec<(Reply, u64)>,
    /// Packets of the master, by number.
    frames: Vec<Vec<u8>>,
    measured: i16,
    rotation: i16,
    fail: Option<(Unsent, usize)>,
    asleep_until: Instant,
    given: u64,
    /// Damage has made a frame, or it is unclear which of two was taken.
    pub(super) is_over: bool,
    /// Virtual time that the actions may still take.
    budget: Duration,
    steps: u64,
    fruitless: u64,
    fruitful: u64,
}

pub(super) fn play<B: Kit>(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let mut session = Session::<B>::new(u.arbitrary()?);
    let begin = session.now;
    for _ in 0..ACTIONS {
        if u.is_empty() {
            break;
        }
        let kind = session.perform(u.arbitrary()?);
        session.check_work(begin);
        if session.is_over {
            tally.did(20);
            return Ok(());
        }
        tally.did(kind);
    }
    end::check(&mut session);
    session.check_work(begin);
    tally.did(if session.is_over { 20 } else { 21 });
    Ok(())
}

impl<B: Kit> Session<B> {
    fn new(setup: Setup) -> Self {
        let ids: Vec<NodeId> = [NodeId::N1, NodeId::N2, NodeId::N6]
            .into_iter()
            .take(1 + usize::from(setup.nodes % 3))
            .collect();
        let start =
            [0, u64::MAX - 30_000, u64::MAX / 2 - 30_000, 1 << 40][usize::from(setup.start % 4)];
        let now = Instant::from_micros(start);
        let mut config = MasterConfig::direct();
        config.polling = [Polling::Fastest, Polling::Every(US(4000)), Polling::Manual]
            [usize::from(setup.polling % 3)];
        config.attempts = setup.attempts % 5;
        config.turnaround_gap = US(u32::from(setup.gap_us % 200));
        config.recovery_share_pct = [5, 0, 1, 50, 100][usize::from(setup.share % 5)];
        config.dead_man = setup.dead_man_ms.map(|ms| Duration::from_millis(ms.into()));
        if setup.knows_nodes {
            config.nodes = ids.iter().copied().collect();
        }
        let mut slave = SlaveConfig::direct();
        slave.watchdog = setup.has_watchdog.then_some(US(10_000));
        let mode =
            |at: usize| if setup.modes >> at & 1 == 0 { Mode::Velocity } else { Mode::Position };
        let stations = ids.iter().enumerate();
        let long = if B::ANSWERS_WRITE { 16 } else { 8 };
        Self {
            now,
            master: Master::for_board(config, now),
            config,
            model: NodeId::ALL.map(|_| Node::default()).into(),
            dead_man: DeadMan { limit: config.dead_man, alive_at: now },
            stations: stations.map(|(at, &id)| Station::new(id, mode(at), slave, now)).collect(),
            // An answer is never later than the guard behind its window.
            to_master: Way::new(20, 700),
            to_slaves: Way::new(20, 90),
            echo: setup.has_echo.then(Echo::new),
            ears: Ears::new(Rules::Ikeya { to_slave: false, to_master: true, long }),
            unheard: Vec::new(),
            answers: Vec::new(),
            frames: Vec::new(),
            measured: 0,
            // Some positions are not a standstill when they are read as a speed.
            rotation: if setup.is_far { 12_300 } else { 3 },
            fail: None,
            asleep_until: now,
            given: 0,
            is_over: false,
            budget: US(60_000),
            steps: 0,
            fruitless: 0,
            fruitful: 1,
        }
    }

    pub(super) fn run_for(&mut self, span: Duration) {
        let end = self.now + span;
        while !self.is_over {
            let Some(at) = self.next_at().filter(|at| *at <= end) else { break };
            self.now = self.now.max(at);
            self.step();
        }
        self.now = self.now.max(end);
        self.stations.iter().for_each(|station| station.check(end));
    }

    fn next_at(&self) -> Option<Instant> {
        let asleep = self.asleep_until;
        let of_master =
            [self.to_master.next_at(), self.master.poll_timeout()].into_iter().flatten();
        let of_slaves = self.stations.iter().filter_map(|station| station.slave.poll_timeout());
        let all =
            of_master.map(|at| at.max(asleep)).chain(self.to_slaves.next_at()).chain(of_slaves);
        all.min()
    }

    fn step(&mut self) {
        self.steps += 1;
        let before = self.fruitful;
        let now = self.now;
        while let Some(piece) = self.to_slaves.arrived(now) {
            self.fruitful += 1;
            for tail in 0..self.stations.len() {
                if !self.stations[tail].is_plugged {
                    continue;
                }
                self.measured = (self.measured + 1) % 8000;
                let place = Position::new(self.measured, self.rotation);
                let is_fine = self.stations[tail].hear(&piece, &self.frames, place, now);
                self.is_over |= !is_fine;
            }
        }
        for tail in 0..self.stations.len() {
            let Some((answer, reply)) = self.stations[tail].serve(now) else { continue };
            self.fruitful += 1;
            if self.stations[tail].is_plugged {
                if reply.mode == Mode::Position {
                    self.model[index(reply.node)].measure(reply.place, now);
                }
                self.answers.push((reply, self.stations[tail].asked));
                self.to_master.send(&answer, self.answers.len() as u64 - 1, now);
            }
        }
        if now >= self.asleep_until {
            self.serve_master();
        }
        self.fruitless += u64::from(self.fruitful == before);
    }

    /// Bounded work, by counters: the loop runs for something that has happened, or rarely.
    fn check_work(&self, begin: Instant) {
        let elapsed = u64::from((self.now - begin).as_micros());
        let most = 20 + 4 * self.fruitful + elapsed / 500;
        assert!(self.fruitless <= most, "{} fruitless rounds of {}", self.fruitless, self.steps);
    }
}

pub(super) fn index(node: NodeId) -> usize {
    usize::from(node.get() - 1)
}
