//! `axle sim` on a system without pseudo-terminals: says so.

use std::ffi::OsString;

use crate::failure::Failure;

/// Not on this system: simulate motors or a rover on a pseudo-terminal of Linux or macOS
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Whatever is asked for.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _rest: Vec<OsString>,
}

/// Runs the subcommand.
pub(crate) fn run() -> Result<(), Failure> {
    let line = "sim needs a pseudo-terminal, which this system does not have: run it on Linux";
    Err(Failure::Usage(line.to_owned()))
}
