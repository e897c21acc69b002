//! The worlds of the drivers, and their initial states.

mod account;
mod action;
mod checks;
mod fault;
mod host;
mod host_account;
mod line;
mod master;
mod node;
mod outcome;
mod port;
mod port_async;
mod replay;
mod task;
mod wire;

use crate::{
    names::*,
    run::{Depth, Run},
};
use {
    action::{Action, Call, Fault, Pass, Setup},
    checks::STALL_US,
    fault::{Failure, Flushing, Pinning, Reading, Writing},
    line::{DrivenLine, Peer, Shared},
    master::{MasterLife, N1},
    node::{Answer, Node, target_payload},
    port::{PART_US, Pin, Wired, failure},
    replay::{Life, Replay},
    task::{End, guarded},
    wire::{Shape, Speech, Wire},
};

const KNOWN: Action = Action::Call(Call::Discover);
const SET: Action = Action::Call(Call::Set(1));
const SERVICE: Action = Action::Call(Call::Service);
const TO_DEADLINE: Action = Action::Pass(Pass::Deadline);
/// The next packet will be cut off: a set-point, or the READ that is due.
const CUT: [Action; 4] = [KNOWN, SET, Action::Fault(Fault::CutOff), Action::Call(Call::Set(2))];

/// The worlds of a master in one mode, blocking or async.
fn worlds<P: Wired>(run: &mut Run, setup: Setup, depth: Depth, starts: &[(&str, &[Action])]) {
    let pin = if P::HAS_PIN { "pin" } else { "no pin" };
    let setup = Setup { has_pin: P::HAS_PIN, is_deep: run.is_deep, ..setup };
    for (name, start) in starts {
        let name = format!("{:?}, {name}, {pin}", setup.mode);
        run.world(&name, depth, Replay::<MasterLife<P>>::new(setup, start));
    }
}

type WithPin = Rs485<Shared, Pin, Pin>;

fn master(run: &mut Run, is_async: bool) {
    let setup =
        Setup { is_async, has_pin: false, mode: Mode::Velocity, dead_man_ms: None, is_deep: false };
    let deep = if is_async { 3 } else { 4 };
    worlds::<WithPin>(run, setup, Depth(2, deep), &[("commanded", &[KNOWN, SET])]);
    let (depth, less) = (Depth(1, 3), Depth(1, if is_async { 2 } else { 3 }));
    worlds::<WithPin>(run, setup, depth, &[("cut off", &CUT)]);
    worlds::<WithPin>(run, setup, less, &[("fresh", &[]), ("known", &[KNOWN])]);
    worlds::<Shared>(run, setup, less, &[("commanded", &[KNOWN, SET]), ("cut off", &CUT)]);
    // A late answer in the other mode is about to arrive.
    let other = Action::Fault(Fault::Answer(Answer::Other));
    let late = [KNOWN, SET, other, TO_DEADLINE, SERVICE, TO_DEADLINE];
    worlds::<Shared>(run, setup, Depth(2, 3), &[("late answer in the other mode", &late)]);
    let position = Setup { mode: Mode::Position, ..setup };
    worlds::<WithPin>(run, position, depth, &[("commanded", &[KNOWN, SET])]);
    let dead_man = Setup { dead_man_ms: Some(3), ..setup };
    worlds::<Shared>(run, dead_man, less, &[("commanded, dead-man", &[KNOWN, SET])]);
}

/// A master with blocking calls.
pub(crate) fn blocking(run: &mut Run) {
    master(run, false);
}

/// A master with async calls.
pub(crate) fn waiting(run: &mut Run) {
    master(run, true);
}

/// A host with blocking calls.
pub(crate) fn host(run: &mut Run) {
    use host::{Action, Call, HostLife};
    let faults = if run.is_deep { 2 } else { 1 };
    let drive = [Action::Call(Call::Drive(20)), Action::Call(Call::Idle)];
    let starts: [(&str, &[Action]); 2] = [("fresh", &[]), ("driving", &drive)];
    for (name, start) in starts {
        let world = Replay::<HostLife<WithPin>>::new(faults, start);
        run.world(&format!("{name}, pin"), Depth(2, 3), world);
        let world = Replay::<HostLife<Shared>>::new(faults, start);
        run.world(&format!("{name}, no pin"), Depth(1, 3), world);
    }
}
