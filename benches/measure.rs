//! A measurement that checks every answer and cannot be empty.

use std::{fmt::Debug, time::Duration};

use criterion::{BenchmarkGroup, Criterion, measurement::WallTime};

/// About a second for each benchmark, so that all of them take minutes. The command line can change
/// it: `-- --measurement-time 5`.
pub(crate) fn criterion() -> Criterion {
    Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600))
        .sample_size(20)
        .nresamples(10_000)
        .configure_from_args()
}

/// Measures `work`, whose every answer must be `expected`; returns how often it ran, which is never
/// if the command line leaves it out.
///
/// # Panics
///
/// Panics if an answer is wrong, or if `work` was to be measured and was not.
pub(crate) fn measure<T: PartialEq + Debug>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    expected: T,
    mut work: impl FnMut() -> T,
) -> u32 {
    let (mut is_wanted, mut answers) = (false, 0);
    group.bench_function(name, |bencher| {
        is_wanted = true;
        bencher.iter(|| {
            assert_eq!(work(), expected, "{name}");
            answers += 1;
        });
    });
    assert_eq!(is_wanted, answers > 0, "{name}: nothing was measured");
    answers
}
