//! What must hold on a bus at every look.

use super::*;
use crate::bus::{ANSWER, READ, WRITE};

/// A WRITE, a READ and an answer of each node, one after another, and as much again for a packet
/// that is repeated.
const LONGEST_LAG_US: u64 = 2 * NODES as u64 * 450;

/// Counts at a look without faults: bytes from and to the head, and from and to the tails.
pub(crate) type Flow = [u64; 4];

impl Bus {
    pub(crate) fn check(&mut self) {
        let bound = self.recovery_bound_us();
        let is_well = self.is_quiet_for(bound);
        for index in 0..NODES {
            self.check_command(index, is_well);
            self.check_motion(index, is_well);
        }
        if is_well {
            self.account.checks.health += 1;
            for node in NodeId::ALL {
                assert_eq!(self.master().health(node), Some(Health::Online), "node {node}");
                // A stop given just now is still owed.
                let is_new =
                    self.line.elapsed() < self.ordered_us[usize::from(node.get() - 1)] + bound;
                let progress = self.master().stop_progress(node);
                assert!(is_new || progress != StopProgress::Owed, "node {node} is owed a stop");
            }
            self.check_lag();
            self.check_flow();
        } else {
            self.flow = None;
        }
        self.looks += 1;
        if self.looks.is_multiple_of(16) {
            self.check_master_sums();
            (0..NODES).for_each(|index| self.check_slave_sums(index));
        }
    }

    /// A slave holds the command that was given, and no other.
    fn check_command(&mut self, index: usize, is_well: bool) {
        let now = self.line.tail(index).role_now();
        let command = self.slave(index).command(now);
        let (order, since) = (self.orders[index], self.ordered_us[index]);
        let elapsed = self.line.elapsed();
        if self.is_cut_off_for(index, self.watchdog_us()) {
            self.account.checks.watchdogs += 1;
            assert_eq!(command, None, "node {index} obeys although it hears nothing");
        }
        let is_settled = is_well && elapsed >= since + self.recovery_bound_us();
        match order {
            Order::Move(target) if is_settled => {
                self.account.checks.commands += 1;
                assert_eq!(command, Some(target), "node {index} does not have its command");
            }
            Order::Stop => self.check_stop(index, command),
            _ => {}
        }
        // A speed that was given to this node before is late, or its stop is on its way.
        if let Some(Target::Velocity(rps)) = command
            && rps.get() != 0.0
            && !self.given[index].contains(&rps.get().to_bits())
        {
            self.account.phantoms += 1;
            assert!(!is_well, "node {index} turns at {rps:?}, which nobody said");
        }
    }

    /// A stop that is paid has been heard, unless the line was damaged meanwhile; then it is
    /// repeated.
    fn check_stop(&mut self, index: usize, command: Option<Target>) {
        let node = NodeId::ALL[index];
        let progress = self.master().stop_progress(node);
        if !matches!(progress, StopProgress::Confirmed | StopProgress::StandingStill) {
            return;
        }
        self.account.checks.paid += 1;
        let is_stopped = match command {
            None => true,
            Some(Target::Velocity(rps)) => rps.get() == 0.0,
            held => held == self.master().set_point(node),
        };
        if !is_stopped {
            self.account.unheard_stops += 1;
            let is_clean = self.is_quiet_for(2 * self.plan.poll_us);
            assert!(!is_clean, "node {node} is said to have stopped, but obeys {command:?}");
        }
    }

    /// A node without a command, or with one to stop, stands still.
    fn check_motion(&mut self, index: usize, is_well: bool) {
        let motor = self.line.tail(index).role.motor();
        let is_still = motor.velocity().get().abs() < 0.05;
        let since = self.ordered_us[index] + self.recovery_bound_us();
        if is_well && self.orders[index] == Order::Stop && self.has_run_out(since) {
            self.account.checks.standstills += 1;
            assert!(is_still, "node {index} turns at {:?} after its stop", motor.velocity());
            // Seen at the next two readings.
            if self.line.elapsed() >= since + 3 * self.plan.poll_us {
                let progress = self.master().stop_progress(NodeId::ALL[index]);
                assert_eq!(progress, StopProgress::StandingStill, "node {index}");
            }
        }
        let run_out = self.watchdog_us() + 1_000_000;
        if self.is_cut_off_for(index, run_out) && index < 6 {
            assert!(is_still, "node {index} turns although it hears nothing");
        }
    }

    /// The Nth READ of each node comes after N periods.
    fn check_lag(&mut self) {
        let lag = self.line.head().beats.lag_us();
        self.account.checks.lags += 1;
        self.account.lag_us = self.account.lag_us.max(lag);
        assert!(lag <= LONGEST_LAG_US, "a READ comes {lag} us after its time");
    }

    /// What one end sends, the other hears.
    fn check_flow(&mut self) {
        let head = self.line.head();
        let tails = self.line.tails();
        let sum = |value: fn(&bus::Tail) -> u64| tails.iter().map(value).sum::<u64>();
        let flow = [head.bytes_out, sum(|it| it.bytes_in), sum(|it| it.bytes_out), head.bytes_in];
        if let Some(before) = self.flow {
            let [sent, heard, answered, received] = [0, 1, 2, 3].map(|i| flow[i] - before[i]);
            // Bytes on their way, if the line is never silent.
            let slack = if self.plan.is_fastest { 12 } else { 0 };
            let sent = sent * NODES as u64;
            assert!(sent.abs_diff(heard) <= 8 * slack, "{heard} of {sent} bytes arrived");
            assert!(answered.abs_diff(received) <= slack, "{received} of {answered} bytes");
        }
        self.flow = Some(flow);
    }

    /// The counts of the master agree with what was counted beside it.
    pub(crate) fn check_master_sums(&mut self) {
        self.account.checks.sums += 1;
        let (head, master) = (self.line.head(), self.master());
        let (all, counters) = (master.statistics(), master.counters());
        assert_eq!(counters.received, head.bytes_in);
        let pending = counters.received - counters.framed - counters.skipped();
        assert!(pending < 8, "{counters:?}");
        assert_eq!(u64::from(all.reads), head.frames[READ]);
        assert_eq!(u64::from(all.writes), head.frames[WRITE]);
        let (mut requests, mut in_flight) = (0, 0);
        for node in NodeId::ALL {
            let node = master.node_statistics(node);
            requests += node.requests;
            in_flight += node.requests - node.replies - node.timeouts;
            assert_eq!(node.latency.count(), node.replies);
            assert!(node.crc_errors <= node.timeouts && node.failures <= node.timeouts);
        }
        assert!(requests == all.reads && in_flight <= 1, "{requests} {in_flight} {all:?}");
        assert_eq!(master.lost_events(), 0);
    }

    /// The same for a slave.
    pub(crate) fn check_slave_sums(&mut self, index: usize) {
        let (tail, slave) = (self.line.tail(index), self.slave(index));
        let (all, counters) = (slave.statistics(), slave.counters());
        assert_eq!(counters.received, tail.bytes_in);
        let pending = counters.received - counters.framed - counters.skipped();
        assert!(pending < 8, "{counters:?}");
        assert_eq!(u64::from(all.replies), tail.frames[ANSWER]);
        assert_eq!(u64::from(all.reads + all.writes + all.foreign), counters.frames);
        assert!(all.reads - all.replies - all.overtaken - all.expired <= 1, "{all:?}");
        assert_eq!(slave.lost_events(), 0);
    }

    /// Notes the frames and the periods of the stations in place.
    pub(crate) fn close_beats(&mut self) {
        let head = self.line.head_mut();
        let (periods, missed) = head.beats.periods();
        let frames = head.frames;
        head.beats = Beats::none();
        self.account.periods += periods;
        self.account.missed_periods += missed;
        self.account.reads += frames[READ];
        self.account.writes += frames[WRITE];
    }
}
