//! A master with eight slaves on a line with faults.

use std::collections::HashSet;

use axlewire::{
    ikeya::{
        Master, Slave,
        master::{MasterConfig, Polling},
        slave::SlaveConfig,
    },
    sim::{Motor, MotorNode},
};

use super::*;
use crate::bus_checks::Flow;

pub(crate) const NODES: usize = 8;

/// Time without a command after which a slave stops its motor.
const WATCHDOG: Duration = Duration::from_millis(2500);

/// Time in which a motor loses 63 % of its speed, and until it stands still from 10 rps.
const TIME_CONSTANT: Duration = Duration::from_millis(50);
const RUN_OUT_US: u64 = 53 * 5000;

/// A READ has 4 bytes and begins with AA, a WRITE 8 and BB; answers are the rest.
fn kind(packet: &[u8]) -> usize {
    match packet[0] {
        0xAA => 0,
        0xBB => 1,
        _ => 2,
    }
}

pub(crate) const READ: usize = 0;
pub(crate) const WRITE: usize = 1;
pub(crate) const ANSWER: usize = 2;

/// The node that a READ is for.
fn read_of(packet: &[u8]) -> Option<usize> {
    (packet[0] == 0xAA).then(|| usize::from(packet[1] - 1))
}

pub(crate) type Head = Station<Master>;
pub(crate) type Tail = Station<MotorNode>;

/// What the application has asked of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Order {
    None,
    Move(Target),
    Stop,
}

pub(crate) struct Bus {
    pub(crate) plan: Plan,
    pub(crate) line: Lane<Head, Tail>,
    pub(crate) schedule: Schedule,
    pub(crate) rng: Rng,
    pub(crate) orders: [Order; NODES],
    /// When each order was given, and since when there is no fault, in microseconds.
    pub(crate) ordered_us: [u64; NODES],
    pub(crate) quiet_us: u64,
    /// Since when each node has been cut off, if it is.
    cut_off_us: [Option<u64>; NODES],
    /// The speeds given to each node, as bits.
    pub(crate) given: [HashSet<u32>; NODES],
    pub(crate) flow: Option<Flow>,
    pub(crate) looks: u64,
    pub(crate) account: Account,
}

impl Bus {
    pub(crate) fn new(plan: Plan) -> Self {
        let start = plan.start();
        let mut rng = Rng::new(plan.seed ^ 0xA99);
        let nodes = NodeId::ALL.into_iter().enumerate();
        let tails =
            nodes.map(|(index, node)| tail(node, index, Position::new(0, 0), &mut rng)).collect();
        Self {
            line: Lane::new(500_000, 0, plan.seed, start, head(&plan, start), tails),
            schedule: Schedule::new(&plan, NODES as u64, End::Head),
            rng,
            orders: [Order::None; NODES],
            ordered_us: [0; NODES],
            quiet_us: 0,
            cut_off_us: [None; NODES],
            given: Default::default(),
            flow: None,
            looks: 0,
            account: Account::default(),
            plan,
        }
    }

    pub(crate) fn master(&self) -> &Master {
        &self.line.head().role
    }

    pub(crate) fn slave(&self, index: usize) -> &Slave {
        self.line.tail(index).role.slave()
    }

    /// Runs to the end of the plan.
    pub(crate) fn run(&mut self) {
        while self.line.elapsed() < self.plan.length_us {
            self.command();
            // Not at the time of a poll.
            let (step, ahead) = (self.plan.step_us, self.plan.step_us * 2 / 3);
            let step_end = ((self.line.elapsed() + ahead) / step + 1) * step - ahead;
            while let Some(edge) = self.schedule.edge_before(step_end) {
                self.line.run_to(edge);
                self.change();
            }
            self.line.run_to(step_end);
            // A motor is simulated up to the last call of its node.
            let now = self.line.now();
            for index in 0..NODES {
                self.line.tail_mut(index).handle_input(&[], now);
            }
            self.react();
            self.check();
        }
        self.settle();
    }

    /// Lets faults end and begin.
    fn change(&mut self) {
        let now = self.line.elapsed();
        for fault in self.schedule.ended(now) {
            if let Fault::BrownOut(tail) = fault {
                self.reset(tail);
            }
            self.account.reliefs += 1;
        }
        if let Some(fault) = self.schedule.begun(now) {
            self.pass_bytes();
            match fault {
                Fault::Reset(tail) => self.reset(tail),
                Fault::ResetHead => self.reset_head(),
                _ => {}
            }
        }
        let pair = self.schedule.pair();
        for index in 0..NODES {
            let is_cut_off = self.schedule.is_cut_off(index);
            self.line.set_unplugged(index, is_cut_off);
            let since = self.cut_off_us[index].unwrap_or(self.line.elapsed());
            self.cut_off_us[index] = (is_cut_off || pair.unplugged).then_some(since);
        }
        self.line.set_faults(pair);
        self.quiet_us = self.line.elapsed();
    }

    /// Runs into the next packet, so that the fault cuts it.
    fn pass_bytes(&mut self) {
        let Some(micros) = self.schedule.micros_into_a_frame() else { return };
        let limit = self.line.now() + Duration::from_micros(2 * self.plan.poll_us as u32);
        while self.line.is_silent() && self.line.step(limit) {}
        self.line.run_for(Duration::from_micros(micros as u32));
    }

    /// A slave starts anew. Its encoder is absolute, so that a hold stays where it is (see the
    /// safety page for one that is not).
    fn reset(&mut self, index: usize) {
        self.check_slave_sums(index);
        let at = self.line.tail(index).role.motor().position();
        let node = NodeId::ALL[index];
        *self.line.tail_mut(index) = tail(node, index, at, &mut self.rng);
        self.account.resets += 1;
    }

    fn reset_head(&mut self) {
        self.check_master_sums();
        self.close_beats();
        let now = self.line.now();
        *self.line.head_mut() = head(&self.plan, now);
        self.orders = [Order::None; NODES];
        self.flow = None;
        self.account.head_resets += 1;
    }

    /// Ends all faults, stops everything, and makes up the account.
    fn settle(&mut self) {
        self.account.faults = self.schedule.counts;
        let now = self.line.now();
        (0..NODES).for_each(|index| self.line.set_unplugged(index, false));
        self.line.set_faults(Faults::CLEAN);
        self.line.head_mut().role.stop_all(now);
        self.line.run_for(Duration::from_millis(3000));
        self.react();
        for node in NodeId::ALL {
            let progress = self.master().stop_progress(node);
            assert_eq!(progress, StopProgress::StandingStill, "node {node} at the end");
        }
        self.check_master_sums();
        (0..NODES).for_each(|index| self.check_slave_sums(index));
        self.close_beats();
    }

    /// Longest time until everything is well after the last fault: one poll, the search for all
    /// nodes, the stops of those that were lost, and a step of the application.
    pub(crate) fn recovery_bound_us(&self) -> u64 {
        let search = 20 * 740 * 2 * NODES as u64;
        let stop = u64::from(self.master().stop_bound().as_micros());
        self.plan.poll_us + search + stop + self.plan.step_us
    }

    /// Whether there has been no fault for this long.
    pub(crate) fn is_quiet_for(&self, micros: u64) -> bool {
        self.schedule.is_quiet() && self.line.elapsed() >= self.quiet_us + micros
    }

    /// Whether a node has been cut off for this long.
    pub(crate) fn is_cut_off_for(&self, index: usize, micros: u64) -> bool {
        self.cut_off_us[index].is_some_and(|since| self.line.elapsed() > since + micros)
    }

    pub(crate) fn has_run_out(&self, since_us: u64) -> bool {
        self.line.elapsed() >= since_us + RUN_OUT_US
    }

    /// How long a slave obeys a command that is not repeated.
    pub(crate) fn watchdog_us(&self) -> u64 {
        WATCHDOG.as_micros().into()
    }
}

fn head(plan: &Plan, now: Instant) -> Head {
    let mut config = MasterConfig::direct();
    config.polling = match plan.is_fastest {
        true => Polling::Fastest,
        false => Polling::Every(Duration::from_micros(plan.poll_us as u32)),
    };
    let mut master = Master::new(config, now);
    master.discover(now);
    let beats = match plan.is_fastest {
        true => Beats::none(),
        false => Beats::new(plan.poll_us, read_of),
    };
    Station::new(master, Clock::Line, kind, beats)
}

/// Six velocity nodes and two position nodes.
fn tail(node: NodeId, index: usize, at: Position, rng: &mut Rng) -> Tail {
    let mode = if index < 6 { Mode::Velocity } else { Mode::Position };
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(WATCHDOG);
    let zero = Instant::from_micros(0);
    let motor = Motor::new().with_time_constant(TIME_CONSTANT).at(at);
    let role = MotorNode::from_parts(Slave::new(node, mode, config, zero), motor);
    Station::new(role, Clock::wrapping(rng.next_u64() as u32), kind, Beats::none())
}
