//! Worlds that cannot be cloned: a state is the list of actions that leads to it, replayed on a
//! fresh driver.

use std::{cell::RefCell, fmt::Debug};

use crate::search::World;

/// A driver with its port, its clock and an independent account.
pub(crate) trait Life: Sized {
    type Setup: Copy;
    type Action: Copy + Debug;

    fn begin(setup: Self::Setup) -> Self;
    /// The possible actions of such a life after these.
    fn actions(setup: Self::Setup, past: &[Self::Action]) -> Vec<Self::Action>;
    fn step(&mut self, action: Self::Action) -> Result<(), String>;
    fn fingerprint(&self) -> u64;
}

pub(crate) struct Replay<L: Life> {
    setup: L::Setup,
    past: Vec<L::Action>,
    /// Those actions that led to the start.
    prepared: usize,
    life: RefCell<Option<L>>,
}

impl<L: Life> Replay<L> {
    /// The state after these actions.
    pub(crate) fn new(setup: L::Setup, prepared: &[L::Action]) -> Self {
        let (past, prepared) = (prepared.to_vec(), prepared.len());
        Self { setup, past, prepared, life: RefCell::default() }
    }

    fn relive(&self) -> L {
        self.life.take().unwrap_or_else(|| {
            let mut life = L::begin(self.setup);
            for &action in &self.past {
                life.step(action).unwrap_or_else(|error| panic!("{action:?} of a start: {error}"));
            }
            life
        })
    }
}

impl<L: Life> Clone for Replay<L> {
    fn clone(&self) -> Self {
        Self { life: RefCell::default(), past: self.past.clone(), ..*self }
    }
}

impl<L: Life> World for Replay<L> {
    type Action = L::Action;

    fn actions(&self) -> Vec<L::Action> {
        L::actions(self.setup, &self.past[self.prepared..])
    }

    fn step(&mut self, action: L::Action) -> Result<(), String> {
        let mut life = self.relive();
        life.step(action)?;
        self.past.push(action);
        self.life = RefCell::new(Some(life));
        Ok(())
    }

    /// Called once for each state: the life is not kept.
    fn fingerprint(&self) -> u64 {
        self.relive().fingerprint()
    }
}
