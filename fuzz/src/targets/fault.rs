//! The faults of a port that a fuzzer chooses, and its driver-enable pin.

use std::{cell::RefCell, collections::VecDeque, rc::Rc};

use arbitrary::Arbitrary;

use super::port::{Step, Unplugged, World};

/// What a port does on one call.
#[derive(Arbitrary, Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Fault {
    /// Nothing unusual.
    None,
    /// Gives or takes at most this many bytes, at least one.
    Few(u8),
    Error,
    /// Reports an end of file, or takes nothing.
    Zero,
    /// Returns this many times 64 µs later; an async call is not ready until then.
    Late(u16),
}

impl Fault {
    pub(super) fn step(self) -> Step {
        match self {
            Self::None => Step::Few(usize::MAX),
            Self::Few(count) => Step::Few(usize::from(count).max(1)),
            Self::Error => Step::Error,
            Self::Zero => Step::Zero,
            Self::Late(units) => Step::Late(u64::from(units) * 64),
        }
    }
}

/// The kinds of calls that can fail.
#[derive(Arbitrary, Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Call {
    Read,
    Write,
    Flush,
    /// The driver-enable pin.
    Pin,
}

#[derive(Clone)]
pub(super) struct Pin {
    pub(super) world: World,
    /// Whether it is on, and whether its next calls fail: they switch it all the same.
    pub(super) state: Rc<RefCell<(bool, VecDeque<bool>)>>,
}

impl Pin {
    fn switch(&self, is_on: bool) -> Result<(), Unplugged> {
        self.world.count_call();
        let mut state = self.state.borrow_mut();
        state.0 = is_on;
        if state.1.pop_front() == Some(true) { Err(Unplugged) } else { Ok(()) }
    }
}

impl embedded_hal::digital::Error for Unplugged {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl embedded_hal::digital::ErrorType for Pin {
    type Error = Unplugged;
}

impl embedded_hal::digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Unplugged> {
        self.switch(false)
    }

    fn set_high(&mut self) -> Result<(), Unplugged> {
        self.switch(true)
    }
}
