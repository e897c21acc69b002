//! Sending given frames; shared by `send` and `replay`.
//!
//! Before: the mode of each node that is commanded is read, and each command is checked against it.
//! After, on every error and on every signal that can be caught: what was commanded is stopped.

mod effect;
mod player;

use std::collections::VecDeque;

use axlewire::{
    ikeya::{
        board::{OneMotor, ThreeMotors},
        master::{MasterConfig, NodeSet},
    },
    time::{Duration, Instant},
    ucp::{self, host::HostConfig},
};

use crate::{
    args::Protocol,
    bus::{self, Boards, Bus, Halt},
    failure::{Failure, guarded},
    line::Line,
    listing::{Modes, Style, TimeColumn},
    rover::Rover,
    session::Session,
    signals::{Attendance, Signals},
    teller::{self, Teller},
};
pub(crate) use effect::{Effect, Limits, Side, of as effect_of};
pub(crate) use player::Due;
use player::Player;

/// What to send, and how.
pub(crate) struct Plan<'a> {
    pub(crate) bus: &'a bus::MasterArgs,
    pub(crate) protocol: Protocol,
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
    let signals = Signals::listen_to_all()?;
    let result = match plan.protocol {
        Protocol::Ikeya => on_bus::<OneMotor>(plan, &signals),
        Protocol::Ikeya3 => on_bus::<ThreeMotors>(plan, &signals),
        Protocol::Ucp => on_rover(plan, &signals),
    };
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

/// The effect of each frame.
fn effects(plan: &Plan<'_>) -> Result<Vec<Effect>, Failure> {
    let effect = |(at, due): (usize, &Due)| match effect_of(plan.protocol, &due.bytes) {
        Ok((_, effect)) => Ok(effect),
        Err(why) => Err(Failure::Failed(format!("frame {} is not sent: {why}", at + 1))),
    };
    plan.frames.iter().enumerate().map(effect).collect()
}

fn on_bus<B: Boards>(plan: Plan<'_>, signals: &Signals) -> Result<(), Failure> {
    let meant = plan.frames.iter().map(|due| due.meant);
    let writes: Vec<_> = effects(&plan)?
        .into_iter()
        .zip(meant)
        .filter_map(|(effect, meant)| match effect {
            Effect::Write(write) => Some((write, meant)),
            _ => None,
        })
        .collect();
    let commanded: NodeSet = writes.iter().map(|(write, _)| write.node).collect();
    let line = Line::open(plan.bus.line(), plan.protocol)?;
    let mut modes = Modes::default();
    if !commanded.is_empty() {
        let mut bus = Bus::<B>::new(line.clone(), config(&plan, commanded, &line));
        if !bus.discover(signals)? {
            return signals.interrupted();
        }
        for node in commanded.iter() {
            let Some(status) = bus.read(node, signals)? else {
                if signals.is_raised() {
                    return signals.interrupted();
                }
                let line =
                    format!("node {node} does not answer: without its mode, nothing is sent to it");
                return Err(Failure::Failed(line));
            };
            modes.learn(node, status.mode());
            for (write, meant) in writes.iter().filter(|(write, _)| write.node == node) {
                write.check(status, *meant, &plan.limits).map_err(Failure::Failed)?;
            }
        }
    }
    let (is_json, config) = (plan.is_json, config(&plan, commanded, &line));
    play(plan, &line, modes, signals, !commanded.is_empty(), || {
        if commanded.is_empty() {
            return Ok(Vec::new());
        }
        let mut bus = Bus::<B>::new(line.clone(), config);
        let failure = bus.stop(commanded).err();
        let complaint = |node| match bus.halt(node) {
            // This master has not heard it, but the one before has.
            Halt::Silent => Some(format!(
                "node {node} was commanded and does not answer any more: it may be moving"
            )),
            _ => bus.complaint(node),
        };
        let complaints: Vec<_> = commanded.iter().filter_map(complaint).collect();
        if !complaints.is_empty() {
            let complaint = complaints.join("; ");
            return Err(match failure {
                Some(failure) => failure.while_moving(&complaint),
                None => Failure::Failed(complaint),
            });
        }
        let told = commanded.iter().map(|node| match is_json {
            true => format!("{{\"event\":\"stopped\",\"node\":{node}}}"),
            false => {
                let status = bus.status(node).map(B::describe).unwrap_or_default();
                format!("node {node}: {status}, stopped and confirmed")
            }
        });
        Ok(told.collect())
    })
}

fn config(plan: &Plan<'_>, nodes: NodeSet, line: &Line) -> MasterConfig {
    let mut config = plan.bus.config();
    config.nodes = nodes;
    bus::complete(config, plan.bus.line(), line)
}

fn on_rover(plan: Plan<'_>, signals: &Signals) -> Result<(), Failure> {
    let drives = effects(&plan)?.contains(&Effect::Drive);
    let line = Line::open(plan.bus.line(), plan.protocol)?;
    let mut config = HostConfig::default();
    config.baud = plan.bus.line().baud.unwrap_or(ucp::BAUD);
    if drives {
        let mut rover = Rover::new(line.clone(), config);
        if !rover.find(|| signals.is_raised())? {
            return signals.interrupted();
        }
    }
    let is_json = plan.is_json;
    play(plan, &line, Modes::default(), signals, drives, || {
        if !drives {
            return Ok(Vec::new());
        }
        let mut rover = Rover::new(line.clone(), config);
        rover.stop()?;
        let report = rover.describe().unwrap_or_default();
        Ok(vec![match is_json {
            true => "{\"event\":\"stopped\"}".to_owned(),
            false => format!("robot: {report}, stopped"),
        }])
    })
}

/// Sends the frames, then stops what they have moved, whatever happened.
fn play(
    plan: Plan<'_>,
    line: &Line,
    modes: Modes,
    signals: &Signals,
    moves: bool,
    stop: impl FnOnce() -> Result<Vec<String>, Failure>,
) -> Result<(), Failure> {
    let style = match plan.is_json {
        true => Style::Json,
        false => Style::text(plan.protocol.number(), TimeColumn::Relative),
    };
    let Plan { protocol, frames, linger_us, .. } = plan;
    let player = |now| Player::new(protocol, frames, linger_us, style, modes, now);
    let mut session = Session::new(line.clone(), player);
    let mut teller = Teller::new();
    let played = guarded(|| until_over(&mut session, &mut teller, signals));
    let lost = session.role().lost;
    let last = guarded(|| Ok(session.role_mut().finish()));
    if let Ok(Some(lines)) = last {
        let _ = teller.say(lines);
    }
    drop(session);
    // In any case, stop first and report errors afterwards.
    let stopped = stop();
    let told = teller.finish().and(line.check_recording());
    for line in stopped? {
        // If the output fails, what moved has stopped all the same.
        drop(teller::print(&line));
    }
    let besides = if moves { "what was commanded is stopped and at rest" } else { "nothing moves" };
    played.map_err(|failure| failure.and(besides))?;
    if lost > 0 {
        let line = format!("{lost} frames did not leave whole; {besides}");
        return Err(Failure::Failed(line));
    }
    told
}

fn until_over(
    session: &mut Session<Player>,
    teller: &mut Teller,
    signals: &Signals,
) -> Result<(), Failure> {
    let mut attendance = Attendance::new(session.now());
    while !signals.is_raised() {
        let now: Instant = session.now();
        attendance.check(now)?;
        if session.role().is_over(now) {
            break;
        }
        if let Some(lines) = session.round(now + CALL_PERIOD)? {
            teller.say(lines)?;
        }
        if let Some((node, mode)) = session.role().turncoat() {
            return Err(Failure::Failed(format!("node {node} has answered in {mode} mode")));
        }
    }
    Ok(())
}
