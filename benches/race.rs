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

/// Runs all contenders in turn and returns the median time of each, seconds.
///
/// # Panics
///
/// Panics if a result is wrong.
#[must_use]
pub fn race<const N: usize>(rounds: usize, contenders: [Contender<'_>; N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    // The first round warms the caches and is not counted.
    for round in 0..=rounds {
        for (contender, times) in contenders.iter().zip(&mut times) {
            let start = Instant::now();
            let found = black_box((contender.work)());
            let seconds = start.elapsed().as_secs_f64();
            assert_eq!(found, contender.expected, "{}", contender.name);
            if round > 0 {
                times.push(seconds);
            }
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}
