//! Sending given frames; shared by `send` and `replay`.
//!
//! What moves something is a command to a role, which sends it, refuses it, or stops: a WRITE to a
//! master, a motor frame to a host. Only frames that move nothing leave as they are. What was
//! commanded is stopped after the last frame, on every error and on every signal that can be
//! caught.

mod effect;
mod hidden;
mod lister;
mod nodes;
mod plan;
mod playing;
mod summary;
mod wheels;

use std::io::{self, Write};

use axlewire::ikeya::{
    Mode,
    board::{OneMotor, ThreeMotors},
};

use crate::{args::Protocol, failure::Failure, line::Line, signals::Signals, teller::Teller};
use effect::Effect;
pub(crate) use effect::{Limits, Side, of as effect_of};
use nodes::Nodes;
pub(crate) use plan::{Due, Plan};
use playing::play;
pub(crate) use summary::Summary;
use wheels::Wheels;

/// Sends the frames of a plan.
pub(crate) fn run(plan: Plan<'_>) -> Result<(), Failure> {
    announce(&plan)?;
    let signals = Signals::listen_to_all()?;
    let result =
        plan.bus.open(plan.protocol).and_then(|line| play_on(plan, line, Teller::new(), &signals));
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

/// Lists the frames of a plan, at their times, without a port.
pub(crate) fn list(plan: &Plan<'_>) -> Result<(), Failure> {
    announce(plan)?;
    for due in &plan.frames {
        if let (Effect::Write(write), Some(Mode::Velocity)) = (&due.effect, due.meant) {
            write.slow(plan.limits.max_rps).map_err(Failure::Failed)?;
        }
    }
    let mut out = io::stdout().lock();
    lister::list(plan, &mut out).map_err(Failure::Write)?;
    if let Some(mut summary) = plan.summary {
        summary.left = plan.frames.len();
        let line = match plan.is_json {
            true => summary.line(plan.side, true),
            false => summary.of_dry_run(plan.side),
        };
        writeln!(out, "{line}").map_err(Failure::Write)?;
    }
    out.flush().map_err(Failure::Write)
}

/// Refuses a plan that would do harm, and says what is not as one would expect.
fn announce(plan: &Plan<'_>) -> Result<(), Failure> {
    hidden::refuse(plan)?;
    for note in &plan.notes {
        eprintln!("axle: {note}");
    }
    Ok(())
}

fn play_on(plan: Plan<'_>, line: Line, teller: Teller, signals: &Signals) -> Result<(), Failure> {
    match plan.protocol {
        Protocol::Ikeya => play::<Nodes<OneMotor>>(plan, line, teller, signals),
        Protocol::Ikeya3 => play::<Nodes<ThreeMotors>>(plan, line, teller, signals),
        Protocol::Ucp => play::<Wheels>(plan, line, teller, signals),
    }
}

#[cfg(all(test, unix))]
mod tests;
