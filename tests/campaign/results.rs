//! The results of all episodes: how long and how far each motor still moved, and its bound.

use std::{collections::BTreeMap, fmt};

/// One motor after one stop.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) kind: &'static str,
    pub(crate) seed: u64,
    /// Time from the stop, or from when the motor was reconnected, to standstill, ms.
    pub(crate) time_ms: f64,
    /// Its bound, ms.
    pub(crate) time_bound_ms: f64,
    /// Distance covered in that time, in `unit`.
    pub(crate) way: f64,
    pub(crate) way_bound: f64,
    pub(crate) unit: &'static str,
    /// What else went wrong, if anything.
    pub(crate) complaint: Option<String>,
}

/// The runs, grouped by kind.
pub(crate) struct Table(BTreeMap<&'static str, Vec<Run>>);

impl Table {
    pub(crate) fn new(runs: Vec<Run>) -> Self {
        let mut kinds: BTreeMap<_, Vec<Run>> = BTreeMap::new();
        for run in runs {
            kinds.entry(run.kind).or_default().push(run);
        }
        Self(kinds)
    }

    /// No run exceeds its bound, and there are runs of each kind.
    pub(crate) fn check(&self) {
        assert!(!self.0.is_empty(), "no motor was ever stopped");
        let is_good = |run: &Run| {
            let is_within = run.time_ms <= run.time_bound_ms && run.way <= run.way_bound;
            is_within && run.complaint.is_none()
        };
        let runs = || self.0.values().flatten();
        let bad: Vec<_> = runs().filter(|run| !is_good(run)).map(|run| (run.seed, run)).collect();
        assert!(bad.is_empty(), "{} of {}, with their seeds: {bad:#?}", bad.len(), runs().count());
    }
}

fn percentile(sorted: &[f64], part: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| motor | runs | measured | 50 % | 90 % | 99 % | 99.9 % | worst | bound |")?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        for (kind, runs) in &self.0 {
            let sorted = |value: fn(&Run) -> f64| {
                let mut values: Vec<f64> = runs.iter().map(value).collect();
                values.sort_by(f64::total_cmp);
                values
            };
            let rows = [
                ("time, ms", sorted(|run| run.time_ms), sorted(|run| run.time_bound_ms)),
                (runs[0].unit, sorted(|run| run.way), sorted(|run| run.way_bound)),
            ];
            for (what, values, bounds) in rows {
                write!(f, "| {kind} | {} | {what} |", runs.len())?;
                for part in [0.5, 0.9, 0.99, 0.999, 1.0] {
                    write!(f, " {:.2} |", percentile(&values, part))?;
                }
                writeln!(f, " {:.2} |", percentile(&bounds, 1.0))?;
            }
        }
        Ok(())
    }
}
