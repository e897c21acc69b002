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
    /// Time from when the cable is back until the node has a stop, and its bound, ms; for a node
    /// that then was still under another command.
    pub(crate) cable: Option<Cable>,
    /// At the time of `Ok` the motor still was under another command.
    pub(crate) is_ok_wrong: bool,
    /// What else went wrong, if anything.
    pub(crate) complaint: Option<String>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Cable {
    pub(crate) time_ms: f64,
    pub(crate) bound_ms: f64,
    /// Something was damaged in this time: a stop may have to be repeated.
    pub(crate) is_damaged: bool,
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
            let is_back = run.cable.is_none_or(|cable| cable.time_ms <= cable.bound_ms);
            is_within && is_back && !run.is_ok_wrong && run.complaint.is_none()
        };
        let runs = || self.0.values().flatten();
        let bad: Vec<_> = runs().filter(|run| !is_good(run)).map(|run| (run.seed, run)).collect();
        assert!(bad.is_empty(), "{} of {}, with their seeds: {bad:#?}", bad.len(), runs().count());
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn percentile(sorted: &[f64], part: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| motor | runs | measured | 50 % | 90 % | 99 % | 99.9 % | worst | bound |")?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        for (kind, runs) in &self.0 {
            let all = |value: fn(&Run) -> f64| sorted(runs.iter().map(value));
            let cables = |is_damaged, value: fn(Cable) -> f64| {
                let cables = runs.iter().filter_map(|run| run.cable);
                sorted(cables.filter(|it| it.is_damaged == is_damaged).map(value))
            };
            let back = |is_damaged| {
                (cables(is_damaged, |it| it.time_ms), cables(is_damaged, |it| it.bound_ms))
            };
            let ((clean, clean_bounds), (damaged, damaged_bounds)) = (back(false), back(true));
            let rows = [
                ("time, ms", all(|run| run.time_ms), all(|run| run.time_bound_ms)),
                (runs[0].unit, all(|run| run.way), all(|run| run.way_bound)),
                ("cable back -> stop at the node, ms", clean, clean_bounds),
                ("the same, with damaged packets", damaged, damaged_bounds),
            ];
            for (what, values, bounds) in rows.iter().filter(|(_, values, _)| !values.is_empty()) {
                write!(f, "| {kind} | {} | {what} |", values.len())?;
                for part in [0.5, 0.9, 0.99, 0.999, 1.0] {
                    write!(f, " {:.2} |", percentile(values, part))?;
                }
                writeln!(f, " {:.2} |", percentile(bounds, 1.0))?;
            }
            if *kind != "rover" {
                let wrong = runs.iter().filter(|run| run.is_ok_wrong).count();
                let what = "`Ok` -> motor still under another command";
                writeln!(f, "| {kind} | {} | {what} | | | | | {wrong} | 0 |", runs.len())?;
            }
        }
        Ok(())
    }
}
