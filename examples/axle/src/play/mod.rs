//! Sending given frames; shared by `send` and `replay`.
//!
//! Before: the mode of each node that is commanded is read, and each command is checked against it.
//! After, on every error and on every signal that can be caught: what was commanded is stopped.

mod commanded;
mod effect;
mod player;

use std::collections::VecDeque;

use axlewire::{
    ikeya::board::{OneMotor, ThreeMotors},
    time::Duration,
};

use crate::{
    args::Protocol,
    bus::MasterArgs,
    failure::{Failure, guarded},
    line::Line,
    listing::{Modes, Style, TimeColumn},
    rover::Rover,
    session::Session,
    signals::Signals,
    teller::Teller,
};
use effect::hidden_frame;
pub(crate) use effect::{Effect, Limits, Side, of as effect_of};
pub(crate) use player::Due;
use player::{Part, Player};

/// What to send, and how.
pub(crate) struct Plan<'a> {
    pub(crate) bus: &'a MasterArgs,
    pub(crate) protocol: Protocol,
    pub(crate) side: Side,
    pub(crate) frames: VecDeque<Due>,
    /// How long to listen behind the last frame, microseconds; what moves does so meanwhile.
    pub(crate) linger_us: u64,
    pub(crate) limits: Limits,
    pub(crate) is_json: bool,
}

/// Longest interval between two rounds.
const CALL_PERIOD: Duration = Duration::from_millis(50);

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

/// Sends the frames, then stops what they have moved, whatever happened: `stop` gets the modes in
/// which the nodes have answered last.
fn play(
    plan: Plan<'_>,
    line: &Line,
    modes: Modes,
    signals: &Signals,
    moves: bool,
    stop: impl FnOnce(Modes) -> Result<Vec<String>, Failure>,
) -> Result<(), Failure> {
    let style = match plan.is_json {
        true => Style::Json,
        false => Style::text(plan.protocol.number(), TimeColumn::Relative),
    };
    let baud = plan.bus.line().baud_for(plan.protocol);
    let holds_rover = plan.protocol == Protocol::Ucp && plan.side == Side::Commander;
    let has_echo = plan.bus.config().removes_echo;
    let Plan { protocol, frames: due, linger_us, .. } = plan;
    let part = Part { protocol, baud, due, linger_us, holds_rover, has_echo, modes };
    let mut session = Session::new(line.clone(), |now| Player::new(part, style, now));
    let mut teller = Teller::new();
    let played = guarded(|| until_over(&mut session, &mut teller, signals));
    let (lost, left) = (session.role().lost, session.role().left());
    let last = guarded(|| Ok(session.role_mut().finish()));
    if let Ok(Some(lines)) = last {
        let _ = teller.say(lines);
    }
    let seen = session.role().seen();
    drop(session);
    // In any case, stop first and report errors afterwards.
    let stopped = stop(seen);
    for line in stopped.iter().flatten() {
        // If the output fails, what moved has stopped all the same.
        let _ = teller.say(line.clone());
    }
    let told = teller.finish();
    stopped?;
    let besides = if moves { "what was commanded is stopped and at rest" } else { "nothing moves" };
    played.map_err(|failure| failure.and(besides))?;
    for (count, what) in [(lost, "did not leave whole"), (left, "not sent: interrupted")] {
        if count > 0 {
            let frames = if count == 1 { "frame" } else { "frames" };
            return Err(Failure::Failed(format!("{count} {frames} {what}; {besides}")));
        }
    }
    told.and_then(|()| line.check_recording())
}

fn until_over(
    session: &mut Session<Player>,
    teller: &mut Teller,
    signals: &Signals,
) -> Result<(), Failure> {
    while !signals.is_raised() {
        let now = session.now();
        session.role_mut().check(now)?;
        if session.role().is_over(now) {
            break;
        }
        if let Some(lines) = session.round(now + CALL_PERIOD)? {
            teller.say(lines)?;
        }
        if let Some((node, now, meant)) = session.role().turncoat() {
            return Err(commanded::turned(node, now, meant));
        }
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests;
