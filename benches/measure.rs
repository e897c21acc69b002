//! A measurement that checks every answer and cannot be empty.

use std::fmt::Debug;

use criterion::{BenchmarkGroup, measurement::WallTime};

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
