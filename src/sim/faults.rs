//! Faults of a wire.

use alloc::vec::Vec;

use super::rng::Rng;
use crate::time::Duration;

/// Faults of a piece of wire. The default has none.
///
/// Rates are probabilities from 0 to 1. Each byte is first lost or not. A byte that is not lost may
/// be damaged, then doubled, and may get a random one in front.
///
/// ```
/// use axlewire::{sim::Faults, time::Duration};
///
/// let mut faults = Faults::noise(1e-4); // one bit in 10,000
/// faults.jitter = Duration::from_micros(30);
/// assert_eq!(faults.lost, 0.0);
/// assert_eq!(Faults::CLEAN, Faults::default());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Faults {
    /// Wrong data bits, per bit.
    pub bit_errors: f64,
    /// Lost bytes, per byte.
    pub lost: f64,
    /// Bytes that arrive twice, per byte. The second one takes no time on the wire.
    pub duplicated: f64,
    /// Random bytes inserted in front of another, per byte. They take no time on the wire.
    pub inserted: f64,
    /// A byte in front of every transmission, as from a transceiver that is switched on. It takes
    /// no time on the wire.
    pub stray: Option<u8>,
    /// Constant delay.
    pub delay: Duration,
    /// Random extra delay, evenly distributed from zero to this. The order of bytes is kept.
    pub jitter: Duration,
    /// Whether the sender hears its own bytes, as with 2-wire adapters, even if the wire behind
    /// them is unplugged.
    pub echo: bool,
    /// Whether the wire is open: nothing gets through.
    pub unplugged: bool,
}

impl Faults {
    /// A wire without faults.
    pub const CLEAN: Self = Self {
        bit_errors: 0.0,
        lost: 0.0,
        duplicated: 0.0,
        inserted: 0.0,
        stray: None,
        delay: Duration::ZERO,
        jitter: Duration::ZERO,
        echo: false,
        unplugged: false,
    };

    /// A wire with bit errors only, at this rate per bit.
    #[must_use]
    pub const fn noise(bit_errors: f64) -> Self {
        Self { bit_errors, ..Self::CLEAN }
    }

    /// The delay of one byte or transmission.
    pub(super) fn hold_up(&self, rng: &mut Rng) -> Duration {
        if self.jitter == Duration::ZERO {
            return self.delay;
        }
        let jitter = rng.below(u64::from(self.jitter.as_micros()) + 1);
        self.delay + Duration::from_micros(jitter as u32)
    }

    /// Passes a byte, and appends the result to `through`. `is_first` marks the first byte of a
    /// transmission.
    pub(super) fn pass(
        &self,
        byte: u8,
        is_first: bool,
        rng: &mut Rng,
        statistics: &mut PairStatistics,
        through: &mut Vec<u8>,
    ) {
        if let (Some(stray), true) = (self.stray, is_first) {
            statistics.inserted += 1;
            through.push(stray);
        }
        if self.inserted > 0.0 && rng.chance(self.inserted) {
            statistics.inserted += 1;
            through.push(rng.byte());
        }
        if self.lost > 0.0 && rng.chance(self.lost) {
            statistics.lost += 1;
            return;
        }
        let mut damaged = byte;
        if self.bit_errors > 0.0 {
            for bit in 0..8 {
                damaged ^= u8::from(rng.chance(self.bit_errors)) << bit;
            }
        }
        statistics.bit_errors += u64::from((byte ^ damaged).count_ones());
        through.push(damaged);
        if self.duplicated > 0.0 && rng.chance(self.duplicated) {
            statistics.duplicated += 1;
            through.push(damaged);
        }
    }
}

/// Statistics of one pair, including the stubs of its senders and receivers.
///
/// ```
/// # use axlewire::sim::PairStatistics;
/// assert_eq!(PairStatistics::default().busy_us, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub struct PairStatistics {
    /// Bytes sent onto the pair.
    pub bytes: u64,
    /// Time with at least one sender talking, µs.
    pub busy_us: u64,
    /// Bytes garbled because they overlapped another sender's.
    pub collided: u64,
    /// Data bits inverted.
    pub bit_errors: u64,
    /// Bytes lost.
    pub lost: u64,
    /// Bytes that arrived twice.
    pub duplicated: u64,
    /// Bytes inserted.
    pub inserted: u64,
}

impl PairStatistics {
    /// [`default`](Self::default), for constants.
    pub(super) const NONE: Self = Self {
        bytes: 0,
        busy_us: 0,
        collided: 0,
        bit_errors: 0,
        lost: 0,
        duplicated: 0,
        inserted: 0,
    };
}
