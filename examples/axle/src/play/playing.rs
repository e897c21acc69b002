//! Sends the frames of a plan, and stops what they have moved.

use std::collections::VecDeque;

use axlewire::{
    ikeya::{Mode, NodeId},
    time::Duration,
};

use super::{
    effect::{Limits, Side},
    player::{Due, Part, Player},
};
use crate::{
    args::Protocol,
    bus::MasterArgs,
    failure::{Failure, guarded},
    line::Line,
    listing::{Modes, Style, TimeColumn},
    session::Session,
    signals::Signals,
    teller::Teller,
};

/// What to send, and how.
pub(crate) struct Plan<'a> {
    pub(crate) bus: &'a MasterArgs,
    pub(crate) protocol: Protocol,
    pub(crate) side: Side,
    pub(crate) frames: VecDeque<Due>,
    /// How long to listen after the last frame, microseconds; motors keep moving meanwhile.
    pub(crate) linger_us: u64,
    pub(crate) limits: Limits,
    pub(crate) is_json: bool,
}

/// Longest interval between two rounds.
const CALL_PERIOD: Duration = Duration::from_millis(50);

/// Sends the frames, then stops what they have moved, whatever happened: `stop` gets the modes in
/// which the nodes have answered last.
pub(super) fn play(
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
            return Err(turned(node, now, meant));
        }
    }
    Ok(())
}

/// A node that may have taken its commands for something else.
pub(super) fn turned(node: NodeId, now: Mode, meant: Mode) -> Failure {
    Failure::Failed(format!(
        "node {node} has changed to {now} mode: it may have taken commands for {meant} mode"
    ))
}
