//! `axle send`: sends single messages, and shows what is said on the line.

mod message;

use std::collections::VecDeque;

use crate::{
    args, bus,
    failure::Failure,
    help::MOTION_HELP,
    play::{self, Due, Limits, Plan, Side},
};
use message::Message;
pub(crate) use message::{Kind, Network};

/// Send one message, and show what is said on the line
///
/// The message is sent once, or --count times every --every seconds, and the line is shown for
/// --for seconds more. A command is given to a master or a host, which sends it or refuses it.
/// Before a WRITE, the mode of its node is read. A node that does not answer, or is in the other
/// mode, gets none, and none gets a speed above --max-rps or a position farther away than
/// --max-turns. Behind each WRITE goes a READ, and another one every 0.1 s with the latest WRITE
/// before it; a node that answers in the other mode, or not at all, gets no more commands. Before a
/// motor command that is not zero, a robot must be heard; the host repeats the latest every 0.1 s,
/// for 0.5 s.
///
/// At the end, on every error and on every signal that can be caught, what was commanded is
/// stopped, as by `axle spin` and `axle drive`. Firmware updates, motor commands out of range,
/// bodies of a wrong length and frames hidden in others are refused (rulings I3, U7 and U13), also
/// as hex digits.
///
/// Frames follow each other no faster than --baud allows. A robot is told to stop by the first
/// frame, and every 0.1 s until a motor command of yours goes out (ruling U16): it would drive on
/// while it hears anything.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP, arg_required_else_help = false)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    #[command(flatten)]
    times: Times,

    #[command(subcommand)]
    message: Message,
}

#[derive(Debug, clap::Args)]
struct Times {
    /// How often to send the message
    #[arg(short, long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    count: u32,

    /// Interval between two of them, seconds
    #[arg(long, value_name = "SECONDS", default_value = "0.1", value_parser = args::seconds)]
    every: u64,

    /// How long to listen after the last one, seconds; motors keep moving meanwhile
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "0.5", value_parser = args::seconds)]
    linger_us: u64,

    /// Whose frames these are: a device's would harm a robot, and are answers that no node gave
    #[arg(long = "as", value_enum, default_value = "commander")]
    side: Side,

    #[command(flatten)]
    limits: Limits,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    play::run(plan(args)?)
}

/// The message, repeated as requested.
fn plan(args: &Args) -> Result<Plan<'_>, Failure> {
    let (protocol, meant) = (args.message.protocol(), args.message.mode());
    let (first, times) = (args.message.bytes(0).map_err(Failure::Usage)?, &args.times);
    let (side, effect) = play::effect_of(protocol, &first)
        .map_err(|why| Failure::Usage(format!("nothing is sent: {why}")))?;
    if side != times.side {
        let line = format!("nothing is sent: the frame is one of a {side}, see --as");
        return Err(Failure::Usage(line));
    }
    let mut frames = VecDeque::new();
    for at in 0..times.count {
        let bytes = args.message.bytes(at as u8).map_err(Failure::Usage)?;
        let after_us = u64::from(at) * times.every;
        frames.push_back(Due { after_us, bytes: bytes.into(), meant, effect: effect.clone() });
    }
    Ok(Plan {
        bus: &args.bus,
        protocol,
        side,
        frames,
        reads_back: true,
        linger_us: times.linger_us,
        limits: times.limits,
        is_json: times.json,
        notes: Vec::new(),
        modes: crate::listing::Modes::default(),
        summary: None,
    })
}

#[cfg(test)]
mod tests;
