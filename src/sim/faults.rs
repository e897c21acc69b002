//! What can be wrong with a wire.

use alloc::vec::Vec;

use super::rng::Rng;
use crate::time::Duration;

/// What a piece of wire does to what passes it. The default does nothing.
///
/// Rates are probabilities from 0 to 1. Each byte is first lost or not; one that is left may be
/// damaged, then doubled, and may get a made-up one in front.
///
/// ```
/// use axlewire::{sim::Faults, time::Duration};
///
/// let mut faults = Faults::noise(1e-4); // every 10,000th bit
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
    /// Random bytes that come in front of another, per byte. They take no time on the wire.
    pub inserted: f64,
    /// A byte in front of the first of every transmission, as from a transceiver that is switched
    /// on. It takes no time on the wire.
    pub stray: Option<u8>,
    /// Time that everything takes longer.
    pub delay: Duration,
    /// Time that things take longer by chance, evenly spread from nothing to this. Nothing
    /// overtakes.
    pub jitter: Duration,
    /// The sender hears its own bytes, as the adapters of 2-wire lines do, even where the wire
    /// behind them is unplugged.
    pub echo: bool,
    /// Nothing gets through.
    pub unplugged: bool,
}

impl Faults {
    /// A good wire.
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

    /// A wire with nothing but wrong bits, of this rate per bit.
    #[must_use]
    pub const fn noise(bit_errors: f64) -> Self {
        Self { bit_errors, ..Self::CLEAN }
    }

    /// How long something is held up this time.
    pub(super) fn hold_up(&self, rng: &mut Rng) -> Duration {
        if self.jitter == Duration::ZERO {
            return self.delay;
        }
        let jitter = rng.below(u64::from(self.jitter.as_micros()) + 1);
        self.delay + Duration::from_micros(jitter as u32)
    }

    /// What becomes of a byte; `is_first` of its transmission.
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

/// What has happened on one pair, the stubs of those who send and hear on it included.
///
/// ```
/// # use axlewire::sim::PairStatistics;
/// assert_eq!(PairStatistics::default().busy_us, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub struct PairStatistics {
    /// Bytes that were sent onto the pair.
    pub bytes: u64,
    /// Time that somebody was talking, µs; talking at the same time counts once.
    pub busy_us: u64,
    /// Bytes that met another sender's and were garbled.
    pub collided: u64,
    /// Data bits turned over.
    pub bit_errors: u64,
    /// Bytes lost.
    pub lost: u64,
    /// Bytes that arrived twice.
    pub duplicated: u64,
    /// Bytes that nobody had sent.
    pub inserted: u64,
}
