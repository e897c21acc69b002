//! Actions on a driver.

use super::{node::Answer, *};
use crate::names::*;

/// A single action.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Action {
    /// Schedules the next fault.
    Fault(Fault),
    Pass(Pass),
    Call(Call),
    /// An async call that is dropped after this many polls.
    Drop(Call, usize),
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Fault {
    Write(Writing),
    /// A frame is cut off: one byte is taken, then the port fails.
    CutOff,
    /// One byte is taken, and the next one after too long a pause.
    Late,
    /// The first half is sent when it is taken, and the rest when it is flushed: too late.
    Held,
    Read(Reading),
    Flush(Flushing),
    Pin(Pinning),
    Answer(Answer),
    /// The node loses power, and with it its command, or gets it back.
    Power,
    /// From now on, WRITEs reach the node damaged, or no longer.
    Deaf,
}

/// Time passes without a call.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Pass {
    /// Shorter than the longest pause inside a frame.
    Short,
    /// Longer than that.
    Pause,
    Deadline,
    PastDeadline,
    Long,
    /// The clock of the driver goes back.
    Back,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Call {
    Service,
    /// Waits for a while.
    Idle,
    Discover,
    /// Set-point 1 or 2.
    Set(u8),
    Stop,
    StopAll,
    Read,
    DriveFor,
    /// Discards what is unsent.
    Discard,
    KeepAlive,
}

impl Fault {
    /// Schedules it.
    pub(crate) fn arrange(self, line: &mut DrivenLine, node: Option<&mut Node>) {
        match (self, node) {
            (Self::Write(writing), _) => line.writes.push_back(writing),
            (Self::CutOff, _) => line.writes.extend([Writing::One, Writing::Error]),
            (Self::Late, _) => line.writes.extend([Writing::One, Writing::Slow]),
            (Self::Held, _) => {
                line.writes.extend([Writing::Half, Writing::Held]);
                line.flushes.push_back(Flushing::Late);
            }
            (Self::Read(reading), _) => line.reads.push_back(reading),
            (Self::Flush(flushing), _) => line.flushes.push_back(flushing),
            (Self::Pin(pinning), _) => line.pins.push_back(pinning),
            (Self::Answer(answer), Some(node)) => node.answers.push_back(answer),
            (Self::Power, Some(node)) => (node.is_gone, node.told) = (!node.is_gone, None),
            (Self::Deaf, Some(node)) => node.is_deaf = !node.is_deaf,
            (Self::Answer(_) | Self::Power | Self::Deaf, None) => {}
        }
    }

    /// Faults of the port and, if there is one, of its pin.
    pub(crate) fn of_port(has_pin: bool, is_async: bool) -> Vec<Self> {
        use {Flushing as F, Reading as R, Writing as W};
        let mut faults = vec![Self::CutOff, Self::Late, Self::Held];
        faults.extend([W::One, W::Half, W::Part, W::Error].map(Self::Write));
        faults.extend([W::Zero, W::Slow, W::Stall].map(Self::Write));
        faults.extend([R::One, R::Error, R::Zero].map(Self::Read));
        faults.extend([R::ErrorAfterWrite, R::ErrorLater].map(Self::Read));
        faults.extend((!is_async).then_some(Self::Read(R::ReadyError)));
        faults.extend([F::ErrorLost, F::ErrorLeft, F::Stall].map(Self::Flush));
        if has_pin {
            faults.extend([Pinning::On, Pinning::Off].map(Self::Pin));
        }
        faults
    }
}

/// The actions of a world with a master.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    pub(crate) is_async: bool,
    pub(crate) has_pin: bool,
    pub(crate) mode: Mode,
    /// The dead-man of the master, milliseconds.
    pub(crate) dead_man_ms: Option<u32>,
    /// Up to two faults may be pending, and async calls are dropped at every poll.
    pub(crate) is_deep: bool,
}

impl Setup {
    /// The possible actions after those in `past`.
    pub(crate) fn actions(self, past: &[Action]) -> Vec<Action> {
        let is_fault = |action: &&Action| matches!(action, Action::Fault(_));
        let waiting = past.iter().rev().take_while(is_fault).count();
        let mut actions = vec![];
        if waiting < if self.is_deep { 2 } else { 1 } {
            let mut faults = Fault::of_port(self.has_pin, self.is_async);
            use Answer as A;
            faults.extend([A::Late, A::Lost, A::Damaged, A::CutOff, A::Other].map(Fault::Answer));
            faults.extend([Fault::Power, Fault::Deaf]);
            actions.extend(faults.into_iter().map(Action::Fault));
        }
        if waiting == 0 {
            use Pass as P;
            let passes = [P::Short, P::Pause, P::Deadline, P::PastDeadline, P::Long, P::Back];
            actions.extend(passes.map(Action::Pass));
            actions.push(Action::Call(Call::Discard));
            actions.extend(self.dead_man_ms.map(|_| Action::Call(Call::KeepAlive)));
        }
        let mut calls = vec![Call::Service, Call::Idle, Call::Set(2), Call::Stop, Call::Read];
        calls.extend((self.mode == Mode::Velocity).then_some(Call::DriveFor));
        calls.push(Call::StopAll);
        if self.is_async {
            for &call in &calls {
                let polls: &[usize] = match (self.is_deep, call) {
                    (true, Call::Service) => &[1, 2, 3, 4],
                    (true, _) => &[1, 2, 3, 4, 5, 7, 9],
                    (false, Call::Service | Call::DriveFor) => &[1, 2],
                    (false, Call::Set(_) | Call::Stop) => &[1, 3],
                    _ => &[2],
                };
                actions.extend(polls.iter().map(|&polls| Action::Drop(call, polls)));
            }
        }
        actions.extend(calls.into_iter().map(Action::Call));
        actions
    }
}
