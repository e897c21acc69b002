//! How long a stop is waited for.

use axlewire::time::Duration;

use super::Halt;

/// Time for which an id must be asked without ever answering before it counts as silent.
const SILENCE: Duration = Duration::from_millis(1000);

/// Time allowed for a motor to coast down after its node has confirmed the stop.
pub(super) const RUN_OUT: Duration = Duration::from_millis(3000);

/// How long to wait for the outcome of a stop.
pub(super) struct Wait {
    /// For the confirmations.
    bound: Duration,
    /// When the last node has confirmed its stop.
    confirmed_at: Option<Duration>,
}

impl Wait {
    pub(super) const fn new(bound: Duration) -> Self {
        Self { bound, confirmed_at: None }
    }

    /// The deadline, with these outcomes so far, some of them of nodes that were not asked often
    /// enough; `None` if there is nothing to wait for.
    pub(super) fn deadline(
        &mut self,
        time: Duration,
        is_any: impl Fn(Halt) -> bool,
        is_unasked: bool,
    ) -> Option<Duration> {
        let is_asking = is_unasked || time < SILENCE;
        if is_any(Halt::Owed) || is_any(Halt::Doubtful) {
            Some(self.bound)
        } else if is_any(Halt::Moving) {
            Some(*self.confirmed_at.get_or_insert(time) + RUN_OUT)
        } else if is_asking && (is_any(Halt::Silent) || is_any(Halt::Damaged)) {
            Some(self.bound)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_has_three_seconds_to_run_out_once_all_have_confirmed_their_stops() {
        let ms = Duration::from_millis;
        let mut wait = Wait::new(ms(5000));
        let mut deadline = |millis, halts: &[Halt], is_unasked| {
            wait.deadline(ms(millis), |halt| halts.contains(&halt), is_unasked)
        };
        assert_eq!(deadline(500, &[Halt::Moving, Halt::Owed], true), Some(ms(5000)));
        assert_eq!(deadline(700, &[Halt::Moving, Halt::Doubtful], true), Some(ms(5000)));
        assert_eq!(deadline(1500, &[Halt::Moving, Halt::Silent], true), Some(ms(4500)));
        assert_eq!(
            deadline(2500, &[Halt::Moving, Halt::Still], false),
            Some(ms(4500)),
            "not again"
        );
        for silent in [Halt::Silent, Halt::Damaged] {
            assert_eq!(deadline(2600, &[silent, Halt::Still], true), Some(ms(5000)));
            assert_eq!(deadline(2600, &[silent, Halt::Still], false), None);
        }
        assert_eq!(deadline(999, &[Halt::Silent], false), Some(ms(5000)));
        assert_eq!(deadline(1000, &[Halt::Silent], false), None);
        assert_eq!(deadline(2700, &[Halt::Still], true), None);
    }
}
