//! Measures contenders in turn, so that other load on the machine affects all of them alike.

use std::{hint::black_box, time::Instant};

use crate::Tally;

/// One side of a comparison.
pub struct Contender<'a> {
    name: String,
    work: Box<dyn Fn() -> Tally + 'a>,
    /// Required result of every run.
    expected: Tally,
}

impl<'a> Contender<'a> {
    /// `work` must return `expected`, or the benchmark panics.
    #[must_use]
    pub fn new(name: &str, expected: Tally, work: impl Fn() -> Tally + 'a) -> Self {
        Self { name: name.into(), work: Box::new(work), expected }
    }
}

/// What tells how long a run takes.
#[derive(Clone, Copy, Debug)]
pub enum Stopwatch {
    /// The time that it takes.
    Real,
    /// The time of the contender with this name, seconds, however long it takes: so that figures
    /// are known, and a test can tell one that is upside down.
    Pretended(fn(&str) -> f64),
}

impl Stopwatch {
    fn time(self, contender: &Contender<'_>) -> (Tally, f64) {
        let start = Instant::now();
        let found = black_box((contender.work)());
        let seconds = match self {
            Self::Real => start.elapsed().as_secs_f64(),
            Self::Pretended(seconds) => seconds(&contender.name),
        };
        (found, seconds)
    }
}

/// Runs all contenders in turn and returns the median time of each, seconds.
///
/// # Panics
///
/// Panics if a result is wrong, if it is the one of doing nothing, or if a run took no time.
#[must_use]
pub fn race<const N: usize>(
    stopwatch: Stopwatch,
    rounds: usize,
    contenders: [Contender<'_>; N],
) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    // The first round warms the caches and is not counted.
    for round in 0..=rounds {
        for (contender, times) in contenders.iter().zip(&mut times) {
            let name = &contender.name;
            assert_ne!(contender.expected, Tally::default(), "{name}: nothing is asked");
            let (found, seconds) = stopwatch.time(contender);
            assert_eq!(found, contender.expected, "{name}");
            assert!(seconds > 0.0, "{name}: no time");
            if round > 0 {
                times.push(seconds);
            }
        }
    }
    times.map(median)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, panic::catch_unwind};

    use super::*;

    const ONE: Tally = Tally { frames: 1, sum: 7 };

    #[test]
    fn the_time_of_a_contender_is_the_median_of_its_own() {
        assert_eq!(median(vec![5.0, 1.0, 100.0, 2.0, 3.0]), 3.0);
        let seconds: fn(&str) -> f64 = |name| if name == "slow" { 8.0 } else { 2.0 };
        let contenders = ["slow", "fast"].map(|name| Contender::new(name, ONE, || ONE));
        assert_eq!(race(Stopwatch::Pretended(seconds), 3, contenders), [8.0, 2.0]);
    }

    #[test]
    fn every_round_runs_every_contender_and_one_more_warms_the_caches() {
        let runs = [Cell::new(0), Cell::new(0)];
        let contenders = runs.each_ref().map(|runs| {
            Contender::new("counts", ONE, || {
                runs.set(runs.get() + 1);
                ONE
            })
        });
        let times = race(Stopwatch::Real, 4, contenders);
        assert_eq!(runs.map(Cell::into_inner), [5, 5]);
        assert!(times.iter().all(|&time| time > 0.0));
    }

    #[test]
    fn a_wrong_answer_is_no_time_and_neither_is_no_question() {
        let result_of = |expected, found| {
            catch_unwind(|| race(Stopwatch::Real, 1, [Contender::new("it", expected, || found)]))
        };
        assert!(result_of(ONE, ONE).is_ok());
        assert!(result_of(ONE, Tally { frames: 1, sum: 0 }).is_err());
        assert!(result_of(ONE, Tally { frames: 0, sum: 7 }).is_err());
        assert!(result_of(Tally::default(), Tally::default()).is_err());
    }
}
