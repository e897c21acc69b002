//! `axle network`: shows a state of the network on the lamp of a rover.

use axlewire::time::Duration;

use crate::{
    args,
    failure::Failure,
    help::EXIT_CODES,
    rover::{CALL_PERIOD, Rover},
    send::Network,
    signals::Signals,
    teller,
};

/// Show a state of the network on the lamp of a rover
///
/// It is sent once, after the robot is heard; no robot acknowledges it, so the tool waits for the
/// answer to a ping behind it. The first frame is a stop,
/// and stops are repeated every 0.1 s (ruling U16): a rover that is driven by another program
/// stops, and its front lamp goes off. Nothing moves because of this subcommand.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// The state
    #[arg(value_enum)]
    state: Network,
}

/// Longest wait for an answer to a ping behind the message.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let mut rover = Rover::open(&args.line)?;
    if !rover.find(|| signals.is_raised())? {
        return Err(Failure::Failed("interrupted before the state was sent".to_owned()));
    }
    let (state, begin) = (args.state.state(), rover.now());
    let shown = rover.host_mut().set_network_state(state, begin);
    shown.map_err(|error| Failure::Failed(error.to_string()))?;
    // It leaves in this round, in front of the pings to come.
    rover.round(begin + CALL_PERIOD)?;
    let mark = rover.mark();
    while !rover.has_heard(&mark) {
        let now = rover.now();
        if now >= begin + PATIENCE || signals.is_raised() {
            let line = format!("network {state}: sent, but the robot does not answer any more");
            return Err(Failure::Failed(line));
        }
        rover.round(now + CALL_PERIOD)?;
    }
    teller::print(&format!("network {state}: sent")).map_err(Failure::Write)?;
    rover.check_recording()
}
