//! What is run.

use super::*;

/// Lengths of a run and of its parts, microseconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    pub(crate) name: &'static str,
    pub(crate) seed: u64,
    pub(crate) length_us: u64,
    /// Every node is read once in this time, unless it is read as fast as the line allows.
    pub(crate) poll_us: u64,
    pub(crate) is_fastest: bool,
    /// Interval between two looks at everything.
    pub(crate) step_us: u64,
    /// The application gives an order in one of so many steps.
    pub(crate) orders_every: u64,
    /// Mean time between two faults, the longest time that a plug is out, and the time after which
    /// the end that must not drift is not reset any more.
    pub(crate) fault_us: u64,
    pub(crate) unplugged_us: u64,
    pub(crate) resets_us: u64,
    /// How much longer all periods of a rover are.
    pub(crate) slower: u32,
}

impl Plan {
    /// An hour before the clock of the line wraps, or a third of a shorter run.
    pub(crate) fn start(&self) -> Instant {
        Instant::from_micros(0_u64.wrapping_sub(HOUR.min(self.length_us / 3)))
    }
}

pub(crate) const SECOND: u64 = 1_000_000;
pub(crate) const HOUR: u64 = 3600 * SECOND;
pub(crate) const DAY: u64 = 24 * HOUR;
