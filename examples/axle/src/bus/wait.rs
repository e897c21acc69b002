//! How long to wait for a stop.

use axlewire::time::{Duration, Instant};

use crate::signals::Awake;

/// Outcome of a stop for one node.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Halt {
    /// The stop is confirmed, and the motor was measured at rest (ruling I12).
    Still,
    /// The stop is confirmed, but the motor was not measured at rest.
    Moving,
    /// The stop is not confirmed.
    Owed,
    /// The stop is not confirmed, because the mode of the node is in doubt (ruling I11).
    Doubtful,
    /// The id has only ever given damaged answers.
    Damaged,
    /// The id has never answered.
    Silent,
}

/// Time for which an id must be asked without ever answering before it counts as silent.
const SILENCE: Duration = Duration::from_millis(1000);

/// Time allowed for a motor to coast down after its node has confirmed the stop.
pub(super) const RUN_OUT: Duration = Duration::from_millis(3000);

/// The wait for the outcome of a stop. A suspension of the tool takes no time of it.
pub(super) struct Wait {
    /// Time for the confirmations.
    bound: Duration,
    /// Time since the beginning.
    awake: Awake,
    /// When the last node has confirmed its stop, on the same clock.
    confirmed_at: Option<Duration>,
}

impl Wait {
    pub(super) const fn new(bound: Duration, now: Instant) -> Self {
        Self { bound, awake: Awake::new(now), confirmed_at: None }
    }

    /// Whether to go on, with these outcomes so far; `is_unasked` if one of the ids that have never
    /// answered was not asked often enough. Call it in every round.
    pub(super) fn goes_on(
        &mut self,
        now: Instant,
        is_any: impl Fn(Halt) -> bool,
        is_unasked: bool,
    ) -> bool {
        let time = self.awake.time(now);
        if is_any(Halt::Owed) || is_any(Halt::Doubtful) {
            time < self.bound
        } else if is_any(Halt::Moving) {
            time < *self.confirmed_at.get_or_insert(time) + RUN_OUT
        } else if is_any(Halt::Silent) || is_any(Halt::Damaged) {
            time < self.bound && (is_unasked || time < SILENCE)
        } else {
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wait with a bound of 5 s, asked every 100 ms.
    struct Asked(Wait, u64);

    impl Asked {
        fn new() -> Self {
            Self(Wait::new(Duration::from_millis(5000), Instant::from_micros(0)), 0)
        }

        /// Goes on until this time with these outcomes; whether it still goes on then.
        fn until(&mut self, millis: u64, halts: &[Halt], is_unasked: bool) -> bool {
            while self.1 < millis {
                self.1 += 100;
                let now = Instant::from_micros(1000 * self.1);
                if !self.0.goes_on(now, |halt| halts.contains(&halt), is_unasked) {
                    return false;
                }
            }
            true
        }
    }

    #[test]
    fn a_motor_has_three_seconds_to_run_out_once_all_have_confirmed_their_stops() {
        let mut wait = Asked::new();
        assert!(wait.until(1000, &[Halt::Moving, Halt::Owed], false));
        assert!(wait.until(2000, &[Halt::Moving, Halt::Doubtful], false));
        assert!(wait.until(3000, &[Halt::Moving, Halt::Silent], false));
        assert!(wait.until(5000, &[Halt::Moving, Halt::Still], false));
        assert!(!wait.until(5100, &[Halt::Moving], false), "confirmed at 2.1 s");
    }

    #[test]
    fn a_stop_that_is_not_confirmed_is_waited_for_until_its_bound() {
        for halt in [Halt::Owed, Halt::Doubtful] {
            let mut wait = Asked::new();
            assert!(wait.until(4900, &[halt, Halt::Still, Halt::Moving], false));
            assert!(!wait.until(5000, &[halt, Halt::Still], true));
        }
    }

    #[test]
    fn an_id_that_never_answers_is_waited_for_for_a_second_and_until_it_was_asked_enough() {
        for halt in [Halt::Silent, Halt::Damaged] {
            let mut wait = Asked::new();
            assert!(wait.until(900, &[halt, Halt::Still], false));
            assert!(wait.until(4000, &[halt], true));
            assert!(!wait.until(4100, &[halt], false));
            assert!(!Asked::new().until(1000, &[halt, Halt::Still], false));
            let mut wait = Asked::new();
            assert!(wait.until(4900, &[halt], true));
            assert!(!wait.until(5000, &[halt], true));
        }
        assert!(!Asked::new().until(100, &[Halt::Still], true), "nothing to wait for");
    }

    #[test]
    fn a_suspended_stop_has_all_of_its_time_afterwards() {
        let mut wait = Asked::new();
        assert!(wait.until(1000, &[Halt::Owed], false));
        wait.1 += 60_000;
        assert!(wait.until(64_000, &[Halt::Owed], false));
        assert!(!wait.until(65_000, &[Halt::Owed], false));
    }
}
