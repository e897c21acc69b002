//! `axle`: the host tool for Ikeya MD and UCP lines.
//!
//! Results go to standard output. Whatever goes wrong is one line on standard error and an exit
//! code that tells whose fault it was.

mod args;
mod bus;
mod ctrl_c;
mod decode;
mod drive;
mod failure;
mod human;
mod input;
mod port;
mod record;
mod scan;
#[cfg(unix)]
mod sim;
mod spin;
mod watch;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; also when the reader of the output has closed it
  1  the input, the output or the port failed, or what hangs on the port did not do as it was told
  2  the command line is wrong";

/// Host tool for Ikeya MD and UCP lines
#[derive(Debug, Parser)]
#[command(name = "axle", version, after_help = EXIT_CODES, arg_required_else_help = false)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Decode(decode::Args),
    Scan(scan::Args),
    Spin(spin::Args),
    Drive(drive::Args),
    Watch(watch::Args),
    #[cfg(unix)]
    Sim(sim::Args),
}

fn main() -> ExitCode {
    let result = match Cli::try_parse() {
        Ok(Cli { command }) => run(&command),
        // --help and --version are "errors" that belong on standard output.
        Err(error) if !error.use_stderr() => error.print().map_err(Failure::Write),
        Err(error) => Err(Failure::usage(&error)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Decode(args) => decode::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Spin(args) => spin::run(args),
        Command::Drive(args) => drive::run(args),
        Command::Watch(args) => watch::run(args),
        #[cfg(unix)]
        Command::Sim(args) => sim::run(args),
    }
}
