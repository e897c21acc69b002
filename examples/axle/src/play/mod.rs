//! Sending given frames; shared by `send` and `replay`.
//!
//! Before: the mode of each node that is commanded is read, and each command is checked against it.
//! After, on every error and on every signal that can be caught: what was commanded is stopped.

mod commanded;
mod effect;
mod player;
mod playing;

use axlewire::ikeya::board::{OneMotor, ThreeMotors};

use crate::{
    args::Protocol, failure::Failure, line::Line, listing::Modes, rover::Rover, signals::Signals,
};
use effect::hidden_frame;
pub(crate) use effect::{Effect, Limits, Side, of as effect_of};
pub(crate) use player::Due;
pub(crate) use playing::Plan;
use playing::play;

/// Sends the frames of a plan.
pub(crate) fn run(plan: Plan<'_>) -> Result<(), Failure> {
    if plan.protocol == Protocol::Ucp && plan.side == Side::Commander {
        let frames = plan.frames.iter().map(|due| &*due.bytes);
        if let Some(number) = hidden_frame(frames) {
            let line = format!(
                "another frame is hidden in frame {}, and a shipped robot may take it (ruling \
                 U13): nothing is sent",
                number + 1
            );
            return Err(Failure::Failed(line));
        }
    }
    let signals = Signals::listen_to_all()?;
    let result = match plan.protocol {
        Protocol::Ikeya => commanded::run::<OneMotor>(plan, &signals),
        Protocol::Ikeya3 => commanded::run::<ThreeMotors>(plan, &signals),
        Protocol::Ucp => on_rover(plan, &signals),
    };
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

fn on_rover(plan: Plan<'_>, signals: &Signals) -> Result<(), Failure> {
    let line = Line::open(plan.bus.line(), plan.protocol)?;
    play_on_rover(plan, line, signals)
}

fn play_on_rover(plan: Plan<'_>, line: Line, signals: &Signals) -> Result<(), Failure> {
    let drives = plan.frames.iter().any(|due| due.effect.moves());
    let args = plan.bus.line();
    if drives {
        let mut rover = Rover::on(line.clone(), args);
        if !rover.find(|| signals.is_raised())? {
            return signals.interrupted();
        }
    }
    let is_json = plan.is_json;
    play(plan, &line, Modes::default(), signals, drives, |_| {
        if !drives {
            return Ok(Vec::new());
        }
        let mut rover = Rover::on(line.clone(), args);
        rover.others_have_pinged();
        rover.stop()?;
        let report = rover.describe().unwrap_or_default();
        Ok(vec![match is_json {
            true => "{\"event\":\"stopped\"}".to_owned(),
            false => format!("robot: {report}, stopped"),
        }])
    })
}

#[cfg(all(test, unix))]
mod tests;
