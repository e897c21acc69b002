//! Time as the roles see it: microseconds, supplied by the caller.
//!
//! No role reads a clock. Pass the time of each call as an [`Instant`], from any free-running
//! source: only differences count. An `Instant` has 64 bits and wraps after 584,000 years. A 32-bit
//! hardware timer wraps after 71 minutes; [`Wrapping32`] extends it to 64 bits. Comparisons use
//! differences, so even the 64-bit wrap is harmless.

use core::{
    cell::Cell,
    cmp::Ordering,
    fmt,
    ops::{Add, AddAssign, Sub},
};

/// A span of time in microseconds, up to 71 minutes.
#[derive(Clone, Copy, Default, Eq, Hash, Ord, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
pub struct Duration {
    micros: u32,
}

/// As that of [`core::time::Duration`]: `1.5ms`.
impl fmt::Debug for Duration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        core::time::Duration::from(*self).fmt(f)
    }
}

impl Duration {
    /// Zero.
    pub const ZERO: Self = Self::from_micros(0);

    /// A span in microseconds.
    #[must_use]
    pub const fn from_micros(micros: u32) -> Self {
        Self { micros }
    }

    /// A span in milliseconds. More than 4,294,967 ms saturate to 71 minutes.
    #[must_use]
    pub const fn from_millis(millis: u32) -> Self {
        Self { micros: millis.saturating_mul(1000) }
    }

    /// A span in seconds. More than 4294 s saturate to 71 minutes.
    #[must_use]
    pub const fn from_secs(secs: u32) -> Self {
        Self { micros: secs.saturating_mul(1_000_000) }
    }

    /// The span in microseconds.
    #[must_use]
    pub const fn as_micros(self) -> u32 {
        self.micros
    }

    /// The span in milliseconds; fractions are cut off.
    #[must_use]
    pub const fn as_millis(self) -> u32 {
        self.micros / 1000
    }

    /// The sum of both spans, at most 71 minutes.
    #[must_use]
    pub const fn saturating_add(self, other: Self) -> Self {
        Self { micros: self.micros.saturating_add(other.micros) }
    }

    /// The span multiplied by `times`, at most 71 minutes.
    #[must_use]
    pub const fn saturating_mul(self, times: u32) -> Self {
        Self { micros: self.micros.saturating_mul(times) }
    }
}

impl Add for Duration {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.saturating_add(other)
    }
}

/// The difference; zero if `other` is longer.
impl Sub for Duration {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { micros: self.micros.saturating_sub(other.micros) }
    }
}

impl From<Duration> for core::time::Duration {
    fn from(span: Duration) -> Self {
        Self::from_micros(span.micros.into())
    }
}

/// Fractions of a microsecond are cut off; more than 71 minutes are an error.
impl TryFrom<core::time::Duration> for Duration {
    type Error = core::num::TryFromIntError;

    fn try_from(span: core::time::Duration) -> Result<Self, Self::Error> {
        span.as_micros().try_into().map(Self::from_micros)
    }
}

/// A point in time, in microseconds since a zero that the caller chooses.
///
/// Of two instants less than 292,000 years apart, the later one is the greater.
///
/// ```
/// use axlewire::time::{Duration, Instant};
///
/// let start = Instant::from_micros(u64::MAX - 100);
/// let end = start + Duration::from_micros(500); // over the wrap
/// assert!(end > start);
/// assert_eq!(end - start, Duration::from_micros(500));
/// assert_eq!(start - end, Duration::ZERO);
/// assert_eq!(end - Duration::from_micros(500), start);
/// assert_eq!(Duration::from_secs(2) - Duration::from_millis(500), Duration::from_millis(1500));
/// assert_eq!((end - start).as_millis(), 0); // fractions are cut off
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Instant {
    micros: u64,
}

impl Instant {
    /// An instant at this number of microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self { micros }
    }

    /// An instant at this number of milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self { micros: millis.wrapping_mul(1000) }
    }

    /// Microseconds since the caller's zero.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.micros
    }

    /// Signed distance from `other` to `self`, microseconds.
    const fn distance(self, other: Self) -> i64 {
        self.micros.wrapping_sub(other.micros) as i64
    }
}

impl Ord for Instant {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance(*other).cmp(&0)
    }
}

impl PartialOrd for Instant {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    fn add(self, span: Duration) -> Self {
        Self { micros: self.micros.wrapping_add(span.micros.into()) }
    }
}

impl AddAssign<Duration> for Instant {
    fn add_assign(&mut self, span: Duration) {
        *self = *self + span;
    }
}

impl Sub<Duration> for Instant {
    type Output = Self;

    fn sub(self, span: Duration) -> Self {
        Self { micros: self.micros.wrapping_sub(span.micros.into()) }
    }
}

/// The time from `other` to `self`: zero if `other` is later, at most 71 minutes.
impl Sub for Instant {
    type Output = Duration;

    fn sub(self, other: Self) -> Duration {
        match self.distance(other) {
            ..0 => Duration::ZERO,
            micros if micros >> 32 != 0 => Duration { micros: u32::MAX },
            micros => Duration { micros: micros as u32 },
        }
    }
}

/// Extends a 32-bit microsecond counter, which wraps every 71 minutes, to [`Instant`]s.
///
/// ```
/// use axlewire::time::Wrapping32;
///
/// let clock = Wrapping32::new();
/// let before = clock.at(0xFFFF_FFF0);
/// let after = clock.at(0x0000_0010); // the counter has wrapped
/// assert_eq!((after - before).as_micros(), 0x20);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Wrapping32 {
    last: Cell<u64>,
}

impl Wrapping32 {
    /// Starts in the first cycle of the counter.
    #[must_use]
    pub const fn new() -> Self {
        Self { last: Cell::new(0) }
    }

    /// The time at this reading of the counter. Pass readings in order, at least one every 71
    /// minutes.
    pub fn at(&self, counter: u32) -> Instant {
        let last = self.last.get();
        let elapsed = counter.wrapping_sub(last as u32);
        self.last.set(last.wrapping_add(elapsed.into()));
        Instant::from_micros(self.last.get())
    }
}

/// The earliest of these deadlines, if there is one.
// One copy for all roles and their drivers: flash matters more than the cost of the call.
#[inline(never)]
pub(crate) fn earliest(deadlines: &[Option<Instant>]) -> Option<Instant> {
    deadlines.iter().flatten().copied().reduce(Instant::min)
}

/// Whether this deadline has been reached.
pub(crate) fn reached(deadline: Option<Instant>, now: Instant) -> bool {
    deadline.is_some_and(|at| at <= now)
}

/// Time that `bytes` bytes take on a line: 10 bit times each, rounded up (ruling B6).
///
/// For a `baud` of 0, the longest span: such a line never finishes.
///
/// ```
/// use axlewire::time::wire_time;
/// assert_eq!(wire_time(4, 500_000).as_micros(), 80); // a READ
/// assert_eq!(wire_time(8, 500_000).as_micros(), 160); // its answer
/// assert_eq!(wire_time(44, 115_200).as_micros(), 3820); // a report
/// ```
#[must_use]
#[inline]
pub const fn wire_time(bytes: usize, baud: u32) -> Duration {
    const BYTE_BIT_MICROS: u32 = 10 * 1_000_000;
    if baud == 0 {
        return Duration::from_micros(u32::MAX);
    }
    // A 64-bit division takes half a kilobyte of flash, and no frame needs one.
    if bytes <= (u32::MAX / BYTE_BIT_MICROS) as usize {
        let bit_micros = bytes as u32 * BYTE_BIT_MICROS;
        return Duration::from_micros(bit_micros.div_ceil(baud));
    }
    let bit_micros = (bytes as u64).saturating_mul(BYTE_BIT_MICROS as u64);
    let micros = bit_micros.div_ceil(baud as u64);
    Duration::from_micros(if micros > u32::MAX as u64 { u32::MAX } else { micros as u32 })
}
