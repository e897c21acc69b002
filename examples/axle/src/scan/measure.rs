//! `axle scan --measure`: how long the nodes of a line take to answer.

use core::fmt;

use axlewire::{
    ikeya::{NodeId, master::NodeSet},
    time::Duration,
};
use serde::Serialize;

use crate::{
    boards::Boards,
    bus::{Bus, Patience},
    failure::Failure,
    signals::Signals,
};

/// READs of each node, and the time after which no more are sent.
const READS: u32 = 100;
const LONGEST: Duration = Duration::from_secs(15);

/// How long a node has taken, from the end of a READ to the start of its answer.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Times {
    node: NodeId,
    reads: u32,
    answers: usize,
    min_us: u32,
    median_us: u32,
    p90_us: u32,
    p99_us: u32,
    max_us: u32,
}

impl Times {
    /// Of all answers; `None` without one.
    fn of(node: NodeId, reads: u32, mut micros: Vec<u32>) -> Option<Self> {
        micros.sort_unstable();
        // The smallest time within which this share of the answers came.
        let within = |percent: usize| {
            let rank = (micros.len() * percent).div_ceil(100).max(1);
            micros.get(rank - 1).copied()
        };
        Some(Self {
            node,
            reads,
            answers: micros.len(),
            min_us: *micros.first()?,
            median_us: within(50)?,
            p90_us: within(90)?,
            p99_us: within(99)?,
            max_us: *micros.last()?,
        })
    }
}

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, reads, answers, .. } = self;
        write!(f, "{node:>4}  {:>11}", format!("{answers} of {reads}"))?;
        [self.min_us, self.median_us, self.p90_us, self.p99_us, self.max_us]
            .into_iter()
            .try_for_each(|micros| write!(f, "  {:>8.2}", f64::from(micros) / 1e3))
    }
}

/// The columns of [`Times`].
pub(super) const TITLES: &str =
    "node      answers   min ms    median       90%       99%       max";

/// Reads each node that has answered, again and again, in turn; each answer has half a second.
pub(super) fn measure<B: Boards>(
    bus: &mut Bus<B>,
    signals: &Signals,
) -> Result<Vec<Times>, Failure> {
    let nodes: NodeSet = bus.nodes().map(|(node, ..)| node).collect();
    let mut times: Vec<_> = nodes.iter().map(|node| (node, 0, Vec::new())).collect();
    bus.begin_patiently(nodes, 1);
    bus.discover(signals)?;
    let begin = bus.now();
    for _ in 0..READS {
        for (node, reads, micros) in &mut times {
            if signals.is_raised() {
                return Err(Failure::Failed("interrupted before all was measured".to_owned()));
            }
            if bus.now() - begin > LONGEST {
                break;
            }
            *reads += 1;
            if bus.read(*node, signals)?.is_some() {
                micros.extend(bus.last_latency(*node).map(Duration::as_micros));
            }
        }
    }
    let times =
        times.into_iter().filter_map(|(node, reads, micros)| Times::of(node, reads, micros));
    Ok(times.collect())
}

/// What this line needs for `--reply-timeout`.
pub(super) fn proposal(times: &[Times]) -> Option<Patience> {
    let slowest = times.iter().map(|times| times.max_us).max()?;
    Some(Patience::for_slowest(Duration::from_micros(slowest)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_the_answers_in_order() {
        let times = Times::of(NodeId::N2, 110, (1..=100).rev().collect()).unwrap();
        assert_eq!((times.min_us, times.median_us, times.p90_us), (1, 50, 90));
        assert_eq!((times.p99_us, times.max_us, times.answers), (99, 100, 100));
        let one = Times::of(NodeId::N2, 1, vec![7]).unwrap();
        assert_eq!((one.min_us, one.median_us, one.p99_us, one.max_us), (7, 7, 7, 7));
        assert!(Times::of(NodeId::N2, 100, vec![]).is_none());
    }
}
