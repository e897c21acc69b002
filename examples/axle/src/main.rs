//! `axle`: the host tool for Ikeya MD and UCP lines.
//!
//! Results go to standard output. Whatever goes wrong is one line on standard error and an exit
//! code that tells whose fault it was.

mod decode;
mod failure;
mod human;
mod input;
mod record;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; also when the reader of the output has closed it
  1  the input could not be read or the output not be written
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
}

fn main() -> ExitCode {
    let result = match Cli::try_parse() {
        Ok(Cli { command: Command::Decode(args) }) => decode::run(&args),
        // --help and --version are "errors" that belong on standard output.
        Err(error) if !error.use_stderr() => error.print().map_err(Failure::Write),
        Err(error) => Err(Failure::usage(&error)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
