//! Runs of the worlds, shallow and deep, with one line for each.

use std::{env, time::Instant};

use super::{
    names::*,
    search::{Limits, explore},
};

/// Search depth of a world: in every test run, and in the deep run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth(pub(crate) usize, pub(crate) usize);

/// Most states of one world, about 3 GB.
const STATES: usize = 1_000_000;

#[derive(Debug)]
pub(crate) struct Run {
    group: &'static str,
    pub(crate) is_deep: bool,
    /// `MODELS_DEPTH`, overriding the depth of all worlds.
    all_depths: Option<usize>,
    violations: Vec<String>,
}

impl Run {
    pub(crate) fn new(group: &'static str, is_deep: bool) -> Self {
        let all_depths = env::var("MODELS_DEPTH").ok();
        let all_depths = all_depths.map(|depth| depth.parse().expect("MODELS_DEPTH: a number"));
        Self { group, is_deep, all_depths, violations: Vec::new() }
    }

    pub(crate) fn world<W: World>(&mut self, name: &str, depth: Depth, start: W) {
        let clock = Instant::now();
        let depth = if self.is_deep { depth.1 } else { depth.0 };
        let depth = self.all_depths.unwrap_or(depth);
        let group = self.group;
        match explore(start, Limits { depth, states: STATES }) {
            Ok(it) => {
                let seconds = clock.elapsed().as_secs_f32();
                println!(
                    "{group:22} {name:34} depth {:2} {:9} states {:9} transitions {seconds:7.2} s",
                    it.depth, it.states, it.transitions
                );
            }
            Err(violation) => {
                println!("{group} {name}: {violation}");
                self.violations.push(format!("{group}, {name}: {violation}"));
            }
        }
    }

    pub(crate) fn end(self) {
        assert!(self.violations.is_empty(), "{}", self.violations.join("\n"));
    }
}
