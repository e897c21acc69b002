//! `axle network`: shows a state of the network on the lamp of a rover.

use axlewire::time::Duration;

use crate::{
    EXIT_CODES, args,
    failure::Failure,
    rover::{CALL_PERIOD, Rover},
    send::Network,
    signals::Signals,
    teller,
};

/// Show a state of the network on the lamp of a rover
///
/// It is sent once, after the robot is heard; no robot acknowledges it. The first frame is a stop,
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

/// Time for the message to leave: much longer than the queue of a host takes.
const SEND_TIME: Duration = Duration::from_millis(300);

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
    while rover.now() < begin + SEND_TIME {
        let until = rover.now() + CALL_PERIOD;
        rover.round(until)?;
    }
    teller::print(&format!("network {state}: sent")).map_err(Failure::Write)?;
    rover.check_recording()
}
