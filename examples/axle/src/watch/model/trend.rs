//! Values over time: rates, and the last values of a sparkline.

/// The rate of an event.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rate {
    pub(crate) count: u64,
    /// `count` at the last measurement.
    measured: u64,
    pub(crate) per_second: f64,
}

impl Rate {
    /// Measures the rate since the last call.
    pub(crate) fn measure(&mut self, seconds: f64) {
        self.per_second = self.count.saturating_sub(self.measured) as f64 / seconds;
        self.measured = self.count;
    }
}

/// Interval between two values of a trend, microseconds.
const STEP: u64 = 500_000;

/// Number of values in a second.
pub(crate) const PER_SECOND: u16 = 2;

/// Number of values in a trend: a minute.
const LEN: usize = 120;

/// The last values, at equal intervals. `NaN` is a time without a value.
#[derive(Clone, Debug)]
pub(crate) struct Trend {
    values: [f32; LEN],
    /// The place of the next value.
    next: usize,
    /// The time at which it is due.
    due: u64,
}

impl Default for Trend {
    fn default() -> Self {
        Self { values: [f32::NAN; LEN], next: 0, due: 0 }
    }
}

impl Trend {
    /// Adds this value for each interval that has passed.
    pub(super) fn tick(&mut self, value: Option<f64>, now: u64) {
        // After a long pause, the earlier values are gone.
        self.due = self.due.max(now.saturating_sub(STEP * LEN as u64));
        while self.due <= now {
            self.due += STEP;
            if let Some(slot) = self.values.get_mut(self.next) {
                *slot = value.map_or(f32::NAN, |value| value as f32);
            }
            self.next = (self.next + 1) % LEN;
        }
    }

    /// The last `count` values, the oldest first.
    pub(crate) fn last(&self, count: usize) -> impl Iterator<Item = f32> + Clone {
        let (newer, older) = self.values.split_at(self.next);
        older.iter().chain(newer).copied().skip(LEN - count.min(LEN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trend_has_one_value_per_interval_whatever_the_pace_of_the_calls() {
        let (mut often, mut seldom) = (Trend::default(), Trend::default());
        for now in (0..=3_000_000).step_by(50_000) {
            often.tick(Some(5.0), now);
        }
        seldom.tick(Some(5.0), 3_000_000);
        let count = |trend: &Trend| trend.last(LEN).filter(|value| *value == 5.0).count();
        assert_eq!((count(&often), count(&seldom)), (7, 7));
    }

    #[test]
    fn the_oldest_value_goes_first_and_a_long_pause_costs_one_round_at_most() {
        let mut trend = Trend::default();
        for at in 0..200 {
            trend.tick(Some(f64::from(at)), u64::from(at as u32) * STEP);
        }
        let last: Vec<_> = trend.last(3).collect();
        assert_eq!(last, [197.0, 198.0, 199.0]);
        trend.tick(None, u64::MAX / 2);
        assert!(trend.last(LEN).all(f32::is_nan));
        assert_eq!(trend.last(usize::MAX).count(), LEN);
    }

    #[test]
    fn a_rate_counts_what_came_since_the_last_measurement() {
        let mut rate = Rate { count: 10, ..Rate::default() };
        rate.measure(2.0);
        assert_eq!(rate.per_second, 5.0);
        rate.measure(2.0);
        assert_eq!(rate.per_second, 0.0);
    }
}
