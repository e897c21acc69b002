//! A breadth-first search over cloned worlds.
//!
//! Written here, in one page, because `stateright` brings 44 packages, including a web server,
//! states no MSRV, and needs a state that is `Hash` and `Eq`, which a role with counters and a
//! clock is not.

use std::{
    collections::HashSet,
    fmt::{self, Debug, Write as _},
};

/// A role, its peers, and an independent account of what it may do.
pub(crate) trait World: Clone {
    /// A single action.
    type Action: Copy + Debug;

    /// The possible actions. One that changes nothing costs time but no state.
    fn actions(&self) -> Vec<Self::Action>;

    /// Performs the action; `Err` names the broken invariant.
    fn step(&mut self, action: Self::Action) -> Result<(), String>;

    /// Equal for two worlds that behave the same from now on.
    fn fingerprint(&self) -> u64;
}

/// When to end a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Most consecutive actions.
    pub(crate) depth: usize,
    /// Most states; the level in which they are reached is not finished.
    pub(crate) states: usize,
}

/// The part explored without a violation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Explored {
    /// Depth to which every sequence of actions was tried.
    pub(crate) depth: usize,
    pub(crate) states: usize,
    pub(crate) transitions: usize,
}

/// The shortest path to a broken invariant.
#[derive(Debug)]
pub(crate) struct Violation {
    pub(crate) actions: Vec<String>,
    pub(crate) invariant: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::new();
        for (number, action) in self.actions.iter().enumerate() {
            writeln!(text, "{:3}. {action}", number + 1)?;
        }
        write!(f, "{} actions:\n{text}{}", self.actions.len(), self.invariant)
    }
}

/// Tries everything, shortest sequences first.
pub(crate) fn explore<W: World>(start: W, limits: Limits) -> Result<Explored, Violation> {
    let mut visited = HashSet::from([start.fingerprint()]);
    // For each state, its predecessor and the action in between; the start has none.
    let mut parents: Vec<Option<(usize, W::Action)>> = vec![None];
    let mut frontier = vec![(0, start)];
    let mut explored = Explored { depth: 0, states: 1, transitions: 0 };
    while explored.depth < limits.depth && !frontier.is_empty() {
        let is_last = explored.depth + 1 == limits.depth;
        let mut next = Vec::new();
        for (index, world) in frontier {
            for action in world.actions() {
                let mut after = world.clone();
                explored.transitions += 1;
                if let Err(invariant) = after.step(action) {
                    let mut actions = path(&parents, index);
                    actions.push(format!("{action:?}"));
                    return Err(Violation { actions, invariant });
                }
                if visited.insert(after.fingerprint()) {
                    explored.states += 1;
                    if explored.states >= limits.states {
                        return Ok(explored);
                    }
                    parents.push(Some((index, action)));
                    if !is_last {
                        next.push((parents.len() - 1, after));
                    }
                }
            }
        }
        explored.depth += 1;
        frontier = next;
    }
    Ok(explored)
}

/// The actions that lead to a state.
fn path<A: Debug>(parents: &[Option<(usize, A)>], mut index: usize) -> Vec<String> {
    let mut actions = Vec::new();
    while let Some((before, action)) = &parents[index] {
        actions.push(format!("{action:?}"));
        index = *before;
    }
    actions.reverse();
    actions
}

#[derive(Clone)]
struct Counter(u32);

impl World for Counter {
    type Action = u32;

    fn actions(&self) -> Vec<u32> {
        vec![1, 3]
    }

    fn step(&mut self, add: u32) -> Result<(), String> {
        self.0 = (self.0 + add) % 10;
        if self.0 == 7 { Err("seven".into()) } else { Ok(()) }
    }

    fn fingerprint(&self) -> u64 {
        self.0.into()
    }
}

#[test]
fn a_violation_is_reported_with_the_shortest_path_to_it() {
    let violation = explore(Counter(0), Limits { depth: 9, states: 100 }).unwrap_err();
    assert_eq!(violation.actions.len(), 3, "{violation}");
    assert_eq!(violation.invariant, "seven");
}

#[test]
fn a_search_ends_at_its_depth_and_counts_each_state_once() {
    let explored = explore(Counter(0), Limits { depth: 2, states: 100 }).unwrap();
    // 0, then 1 and 3, then 2, 4 (twice) and 6.
    assert_eq!(explored, Explored { depth: 2, states: 6, transitions: 6 });
    let explored = explore(Counter(0), Limits { depth: 9, states: 4 }).unwrap();
    assert_eq!((explored.depth, explored.states), (1, 4));
}
