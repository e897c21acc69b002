//! `axle sim`: simulates motors or a rover on a pseudo-terminal.

mod faults;
mod ikeya;
mod link;
mod pty;
mod stage;
mod ucp;

use axlewire::ikeya::board::{OneMotor, ThreeMotors};

use crate::{failure::Failure, help::EXIT_CODES};

/// Simulate motors or a rover on a pseudo-terminal
///
/// The first line of the output is `pty: PATH`, or with --json an object with `path`: use that
/// path, or that of --link, as the --port of another program. The following lines show what
/// happens, until Ctrl-C or the end of --for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES, arg_required_else_help = false)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Simulate boards with one motor on a bus, which answer and turn as commanded
    Ikeya(ikeya::Args),
    /// Simulate boards with three motors on a bus, which answer and turn as commanded
    #[command(name = "ikeya-3")]
    Ikeya3(ikeya::Args),
    Ucp(ucp::Args),
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.what {
        What::Ikeya(args) => ikeya::run::<OneMotor>(args),
        What::Ikeya3(args) => ikeya::run::<ThreeMotors>(args),
        What::Ucp(args) => ucp::run(args),
    }
}
