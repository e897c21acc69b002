//! Building blocks of all roles' statistics: counts that stop at 2^32 - 1, and latencies.

use crate::time::Duration;

/// Adds one.
#[inline]
pub(crate) const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Adds one, out of line: saves code size in a role that counts in many places.
#[inline(never)]
pub(crate) const fn count_apart(counter: &mut u32) {
    count(counter);
}

/// Adds `number`.
#[cfg(feature = "ikeya")]
#[inline]
pub(crate) const fn add(counter: &mut u32, number: u32) {
    *counter = counter.saturating_add(number);
}

/// Takes back one that was counted but did not happen.
#[inline]
pub(crate) const fn uncount(counter: &mut u32) {
    *counter = counter.saturating_sub(1);
}

/// Times from a request to its answer: count, latest, fastest, slowest and mean.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Latency {
    count: u32,
    last_us: u32,
    min_us: u32,
    max_us: u32,
    sum_us: u64,
}

impl Latency {
    /// [`default`](Self::default), for constants.
    #[cfg(feature = "ikeya")]
    pub(crate) const NEW: Self = Self { count: 0, last_us: 0, min_us: 0, max_us: 0, sum_us: 0 };

    pub(crate) fn add(&mut self, latency: Duration) {
        let micros = latency.as_micros();
        self.min_us = if self.count == 0 { micros } else { self.min_us.min(micros) };
        self.max_us = self.max_us.max(micros);
        self.last_us = micros;
        // The sum of 2^32 values of 32 bits fits into 64 bits. Counting beyond that would skew the
        // mean.
        if let Some(count) = self.count.checked_add(1) {
            self.count = count;
            self.sum_us += u64::from(micros);
        }
    }

    /// Number of answers measured; stops at 2^32 - 1.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// The latest time; `None` before the first answer.
    #[must_use]
    pub const fn last(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.last_us)) }
    }

    /// The shortest time; `None` before the first answer.
    #[must_use]
    pub const fn min(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.min_us)) }
    }

    /// The longest time; `None` before the first answer.
    #[must_use]
    pub const fn max(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.max_us)) }
    }

    /// Mean of the first 2^32 - 1 times, rounded down to a microsecond; `None` before the first
    /// answer.
    #[must_use]
    pub const fn mean(&self) -> Option<Duration> {
        match self.sum_us.checked_div(self.count as u64) {
            Some(mean) => Some(Duration::from_micros(mean as u32)),
            None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_stays_right_when_the_count_has_reached_its_end() {
        let mut latency =
            Latency { count: u32::MAX, sum_us: u64::from(u32::MAX) * 50, ..Latency::default() };
        for _ in 0..3 {
            latency.add(Duration::from_micros(50));
        }
        assert_eq!((latency.count(), latency.mean()), (u32::MAX, Some(Duration::from_micros(50))));
    }

    #[test]
    fn a_count_stops_at_its_largest_value() {
        let mut counter = u32::MAX - 1;
        count(&mut counter);
        count(&mut counter);
        assert_eq!(counter, u32::MAX);
    }
}
