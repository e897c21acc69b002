//! What has happened in a run.

use super::*;
use crate::plan::DAY;

/// Counts of a run, made by the test.
#[derive(Debug, Default)]
pub(crate) struct Account {
    /// Faults that began, by kind, and that ended.
    pub(crate) faults: [u64; 5],
    pub(crate) reliefs: u64,
    pub(crate) resets: u64,
    pub(crate) head_resets: u64,
    /// Orders of the application that were accepted: moves and stops; and those refused.
    pub(crate) orders: [u64; 2],
    pub(crate) refused: u64,
    pub(crate) answers: u64,
    pub(crate) failed_reads: u64,
    pub(crate) lost_nodes: u64,
    pub(crate) stopped: u64,
    pub(crate) stood_still: u64,
    /// READs and WRITEs, or reports and no WRITEs, of all stations that there were.
    pub(crate) reads: u64,
    pub(crate) writes: u64,
    /// Checks made, by what is checked.
    pub(crate) checks: Checks,
    /// Longest time from the end of the last fault until a node was online again.
    pub(crate) recovery_us: u64,
    /// Commands in a slave that nobody gave: damage that passed for a packet.
    pub(crate) phantoms: u64,
    /// Stops that were paid while a damaged line kept the node from hearing them.
    pub(crate) unheard_stops: u64,
    /// Periods with and without a frame, and the largest lag of one after as many periods.
    pub(crate) periods: u64,
    pub(crate) missed_periods: u64,
    pub(crate) lag_us: u64,
}

#[derive(Debug, Default)]
pub(crate) struct Checks {
    pub(crate) sums: u64,
    pub(crate) standstills: u64,
    pub(crate) commands: u64,
    pub(crate) watchdogs: u64,
    pub(crate) health: u64,
    pub(crate) lags: u64,
    pub(crate) paid: u64,
}

impl Account {
    /// Something was back again, so long after the last fault, microseconds.
    pub(crate) fn recover(&mut self, at: u64, quiet_us: u64) {
        self.recovery_us = self.recovery_us.max(at.saturating_sub(quiet_us));
    }

    /// Prints everything; `what` is what was counted in `reads`.
    pub(crate) fn print(&self, plan: &Plan, what: &str, seconds: f64) {
        let Self { checks, .. } = self;
        let days = plan.length_us as f64 / DAY as f64;
        let each = seconds * 1e6 / self.reads.max(1) as f64;
        println!("{}: {days:.2} days in {seconds:.0} s, {each:.2} us per {what}", plan.name);
        println!(
            "  {} {what}, {} WRITE, {} answers or reports",
            self.reads, self.writes, self.answers
        );
        let faults = Fault::NAMES.iter().zip(self.faults);
        let faults: Vec<_> = faults.map(|(name, count)| format!("{count} {name}")).collect();
        println!("  faults: {}; {} are over", faults.join(", "), self.reliefs);
        println!("  orders: {:?} moves and stops, {} refused", self.orders, self.refused);
        println!(
            "  {} times a node or the link was lost; back after at most {:.1} ms",
            self.lost_nodes,
            self.recovery_us as f64 / 1e3
        );
        println!("  {} stops paid, {} standstills seen", self.stopped, self.stood_still);
        println!(
            "  {} looks at a stop that a damaged line had swallowed twice, {} at a made-up command",
            self.unheard_stops, self.phantoms
        );
        println!(
            "  {} periods, {} without a frame; the Nth frame at most {} us after N periods",
            self.periods, self.missed_periods, self.lag_us
        );
        println!("  {checks:?}");
    }
}
