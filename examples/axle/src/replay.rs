//! `axle replay`: sends the frames of a capture, at their own pace or faster.

mod pace;

use std::{collections::VecDeque, path::PathBuf};

use crate::{
    args::{self, Protocol},
    bus,
    decode::{self, SHORT_STEP_US, Taken, Walked},
    failure::Failure,
    help::MOTION_HELP,
    input::Form,
    pcapng::Direction,
    play::{self, Due, Limits, Plan, Side, Summary},
};
use pace::Pace;

/// Send the frames of a capture, at their own pace or faster
///
/// Sends what one side of the line sent, frame by frame, and shows both sides. Bytes between frames
/// are not sent. Raw bytes have no times: their frames follow each other at --every. No frame is
/// sent faster than --baud allows. A frame follows the one before it in the capture, so a clock
/// that was set meanwhile changes nothing but that one step.
///
/// Frames that command motors or a rover need --move, and are given to a master or a host, which
/// sends them or refuses them. Before, the modes of all nodes that are commanded are read, and
/// nothing is sent if a node does not answer, if it is not in the mode that it had in the capture,
/// or if it would get more than --max-rps or go farther than --max-turns: a speed looks like a far
/// position, and the reverse. The master also reads each node every 0.1 s and repeats its latest
/// command; it leaves out READs of nodes that do not answer. The host tells a robot to stop first,
/// repeats the command in force every 0.1 s, in place of the repeats of the capture (ruling U16),
/// and tells the robot to stop 0.5 s after the latest one. A node that turns or falls silent and a
/// robot that is no longer heard end the replay. At the end, on every error and on every signal
/// that can be caught, what was commanded is stopped.
///
/// Of a capture with several lines, --interface chooses one. A capture in which a commanded node
/// changes its mode is refused. Firmware updates, motor commands out of range, bodies of a wrong
/// length and frames hidden in others, also in those of a device, are refused (rulings I3, U7 and
/// U13).
///
/// The capture is held in memory: 4 to 40 times its size, most for the short packets of a bus.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
#[command(mut_arg("port", without_dry_run))]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// Protocol of the line; needed for raw bytes
    #[arg(short = 'P', long, value_enum)]
    protocol: Option<Protocol>,

    /// Whose frames to send
    #[arg(long = "as", value_enum, default_value = "commander")]
    side: Side,

    /// How much faster than recorded; 0.5 is half as fast
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = factor)]
    speed: f64,

    /// Longest pause between two frames, seconds of the capture; a longer one is shortened to it,
    /// and that is said
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = args::seconds)]
    longest_pause: u64,

    /// The line to send, if a capture has several: its number from 0, as decode shows it
    #[arg(long, value_name = "N")]
    interface: Option<usize>,

    /// Interval between two frames of raw bytes, seconds
    #[arg(long, value_name = "SECONDS", default_value = "0.02", value_parser = args::seconds)]
    every: u64,

    /// Send commands that move something
    #[arg(long = "move")]
    moves: bool,

    /// List what would be sent and when, without a port
    #[arg(long)]
    dry_run: bool,

    #[command(flatten)]
    limits: Limits,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,

    #[command(flatten)]
    form: Form,

    /// The capture. Several, and folders of them, follow each other in the order of time
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

/// A dry run needs no port.
fn without_dry_run(port: clap::Arg) -> clap::Arg {
    port.required(false)
        .required_unless_present("dry_run")
        .default_value_if("dry_run", "true", "")
        .hide_default_value(true)
}

fn factor(text: &str) -> Result<f64, String> {
    let factor: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.001..=1000.0).contains(&factor) {
        Ok(factor)
    } else {
        Err(format!("{factor:?} is not within 0.001..=1000"))
    }
}

/// How long to listen after the last frame, microseconds.
const LINGER_US: u64 = 200_000;

/// Longest time of a replay, microseconds.
const LONGEST_US: u64 = 365 * 86_400_000_000;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (plan, walked) = plan(args)?;
    if args.dry_run {
        play::list(&plan)?
    } else {
        play::run(plan)?
    }
    walked.missing()
}

/// The frames of one side of the capture, each with its time.
fn plan(args: &Args) -> Result<(Plan<'_>, Walked), Failure> {
    let (protocol, mut taken, walked) =
        decode::frames_of(&args.files, args.form, args.protocol, args.interface)?;
    if !walked.is_set_back {
        // A frame behind a false start comes late, and files of one line may overlap.
        taken = in_order_of_time(taken);
    }
    let mut frames = Vec::new();
    let mut pace = Pace::new(args.speed, args.longest_pause);
    let (mut echoes, mut summary) = (Echoes::default(), Summary::default());
    summary.skipped_bytes = walked.account.skipped();
    for Taken { micros, direction, bytes, commands } in taken {
        let due_us = micros.map(|micros| pace.due_us(micros));
        let (side, effect) = match play::effect_of(protocol, &bytes) {
            Ok(found) => found,
            // Only a commander's frames can be refused.
            Err(why) if args.side == Side::Commander => {
                return Err(Failure::Failed(format!("the capture has {why}: nothing is sent")));
            }
            Err(_) => {
                summary.other_side += 1;
                continue;
            }
        };
        if side != args.side {
            summary.other_side += 1;
            continue;
        }
        if echoes.has(direction, micros, &bytes) {
            summary.echoes += 1;
            continue;
        }
        let last_us = frames.last().map(|due: &Due| due.after_us);
        let unknown_us = last_us.map_or(0, |last_us| last_us + args.every);
        let after_us = due_us.unwrap_or(unknown_us).max(last_us.unwrap_or(0));
        if after_us > LONGEST_US {
            let line = format!("frame {} is due after more than a year", frames.len() + 1);
            return Err(Failure::Failed(line));
        }
        // The answers in the capture say how its commands were meant.
        let meant = commands.and_then(|node| walked.modes.of(node));
        frames.push(Due { after_us, bytes, meant, effect });
    }
    // It begins with the first of them.
    let begin_us = frames.first().map_or(0, |due| due.after_us);
    frames.iter_mut().for_each(|due| due.after_us -= begin_us);
    if frames.is_empty() {
        let line = format!("no frame of a {} in the capture", args.side);
        return Err(Failure::Failed(line));
    }
    let moving = frames.iter().filter(|due| due.effect.moves()).count();
    if moving > 0 && !args.moves && !args.dry_run {
        return Err(Failure::Failed(format!(
            "{moving} of {} frames move something: use --move if you mean it; nothing is sent",
            frames.len()
        )));
    }
    let plan = Plan {
        bus: &args.bus,
        protocol,
        side: args.side,
        frames: frames.into(),
        reads_back: false,
        linger_us: LINGER_US,
        limits: args.limits,
        is_json: args.json,
        notes: pace.notes(),
        modes: walked.modes,
        summary: Some(summary),
    };
    Ok((plan, walked))
}

/// Those of one direction stay in their order, and frames without a time behind the one before.
fn in_order_of_time(taken: Vec<Taken>) -> Vec<Taken> {
    let mut latest = [0; 3];
    let timed = taken.into_iter().map(|taken| {
        let latest = match taken.direction {
            Some(Direction::Out) => &mut latest[0],
            Some(Direction::In) => &mut latest[1],
            None => &mut latest[2],
        };
        // A file of later times comes later, and none goes back by more than a moment.
        *latest = match taken.micros {
            Some(micros) if micros + SHORT_STEP_US < *latest => micros,
            Some(micros) => micros.max(*latest),
            None => *latest,
        };
        (*latest, taken)
    });
    let mut timed: Vec<_> = timed.collect();
    timed.sort_by_key(|(micros, _)| *micros);
    timed.into_iter().map(|(_, taken)| taken).collect()
}

/// Bytes that the recording program has sent, and may have received as its own echo.
#[derive(Default)]
struct Echoes(VecDeque<(Option<u64>, Box<[u8]>)>);

impl Echoes {
    /// Longest time from a frame to its echo, microseconds, and most frames meanwhile.
    const LATEST_US: u64 = 1_000_000;
    const MOST: usize = 64;

    /// Whether this is the echo of a frame before it, which is then over.
    fn has(&mut self, direction: Option<Direction>, micros: Option<u64>, bytes: &[u8]) -> bool {
        let is_over = |sent: Option<u64>| {
            let apart = micros.zip(sent).map(|(now, sent)| now.abs_diff(sent));
            apart.is_some_and(|apart| apart > Self::LATEST_US)
        };
        while self.0.front().is_some_and(|(sent, _)| is_over(*sent)) {
            self.0.pop_front();
        }
        if direction == Some(Direction::Out) {
            self.0.push_back((micros, bytes.into()));
            if self.0.len() > Self::MOST {
                self.0.pop_front();
            }
            return false;
        }
        // Echoes come in the order of what was sent, some of them damaged, and before anything that
        // others say.
        match self.0.iter().position(|(_, sent)| **sent == *bytes) {
            Some(place) => {
                self.0.drain(..=place);
                true
            }
            None => {
                self.0.clear();
                false
            }
        }
    }
}

#[cfg(test)]
mod tests;
