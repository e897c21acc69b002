//! `axle lamp`: switches the front lamp of a rover.

use axlewire::{time::Duration, ucp::MotorControl};

use crate::{
    args,
    failure::Failure,
    help::EXIT_CODES,
    rover::{CALL_PERIOD, Rover},
    signals::Signals,
    teller,
};

/// Switch the front lamp of a rover on or off
///
/// The lamp is part of the motor command, so a rover that moves stops: the first frame is a stop,
/// with the lamp off, and after the robot is heard it gets three commands to stand still with the
/// lamp as asked for. No robot acknowledges them. The next motor command of any program sets the
/// lamp anew.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// Whether to switch it on
    #[arg(value_enum)]
    state: State,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, clap::ValueEnum)]
enum State {
    /// On
    On,
    /// Off
    Off,
}

/// Number of commands sent: they are not acknowledged, so any may be lost.
const COMMANDS: u32 = 3;

/// Longest time for sending them; they are 100 ms apart.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let mut rover = Rover::open(&args.line)?;
    let interrupted = || Err(Failure::Failed("interrupted".to_owned()));
    if !rover.find(|| signals.is_raised())? {
        return interrupted();
    }
    let is_on = args.state == State::On;
    let command = MotorControl::STOP.with_front_led(is_on);
    let (begin, before) = (rover.now(), rover.host().statistics().commands);
    while rover.host().statistics().commands.saturating_sub(before) < COMMANDS {
        let now = rover.now();
        if signals.is_raised() {
            return interrupted();
        }
        if now >= begin + PATIENCE {
            return Err(Failure::Failed("the port does not take the command".to_owned()));
        }
        let driven = rover.host_mut().drive(command, now);
        driven.map_err(|error| Failure::Failed(error.to_string()))?;
        rover.round(now + CALL_PERIOD)?;
    }
    let state = if is_on { "on" } else { "off" };
    teller::print(&format!("lamp {state}: told {COMMANDS} times")).map_err(Failure::Write)?;
    rover.check_recording()
}
