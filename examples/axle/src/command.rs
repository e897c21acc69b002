//! The command line.

use std::{ffi::OsString, process::ExitCode};

use clap::{
    Command as Description, CommandFactory, FromArgMatches, Parser, Subcommand, error::ErrorKind,
};

#[cfg(not(unix))]
use crate::no_sim;
#[cfg(unix)]
use crate::sim;
use crate::{
    bugreport, calibrate, decode, drive, export, extcap, failure::Failure, help::EXIT_CODES, lamp,
    manual, network, ping, plot, ports, record, replay, scan, send, spin, stop, watch,
};

/// Host tool for Ikeya MD and UCP lines
#[derive(Debug, Parser)]
#[command(name = "axle", bin_name = "axle", version)]
#[command(after_help = EXIT_CODES, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Decode(decode::Args),
    Plot(plot::Args),
    Export(export::Args),
    Scan(scan::Args),
    Spin(spin::Args),
    Drive(drive::Args),
    Stop(stop::Args),
    Ping(ping::Args),
    Calibrate(calibrate::Args),
    Lamp(lamp::Args),
    Network(network::Args),
    Watch(watch::Args),
    Record(record::Args),
    Extcap(extcap::Args),
    Replay(replay::Args),
    Send(send::Args),
    #[cfg(unix)]
    Sim(sim::Args),
    Ports(ports::Args),
    Bugreport(bugreport::Args),
    Completions(manual::CompletionsArgs),
    Man(manual::ManArgs),
    #[cfg(not(unix))]
    Sim(no_sim::Args),
}

/// Runs the tool with these arguments, of which the first is its name.
#[must_use]
pub fn run_with(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let parsed = description().try_get_matches_from(args).and_then(|matches| {
        Cli::from_arg_matches(&matches).map_err(|error| error.with_cmd(&description()))
    });
    let result = match parsed {
        Ok(Cli { command }) => run(&command),
        // --help and --version are "errors" that go to standard output.
        Err(error) if !error.use_stderr() => error.print().map_err(Failure::Write),
        Err(error) if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            // If standard error is closed, there is nowhere to print it.
            let _ = error.print();
            return ExitCode::from(2);
        }
        Err(error) => Err(Failure::usage(&error)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// All subcommands with their arguments.
pub(crate) fn description() -> Description {
    with_negative_numbers(Cli::command())
}

/// Takes a negative number for a value, so that the message names the range, not an unknown option.
fn with_negative_numbers(command: Description) -> Description {
    command.mut_subcommands(with_negative_numbers).mut_args(|arg| {
        let takes_value = arg.get_action().takes_values() && !arg.is_positional();
        if takes_value { arg.allow_negative_numbers(true) } else { arg }
    })
}

fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Decode(args) => decode::run(args),
        Command::Plot(args) => plot::run(args),
        Command::Export(args) => export::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Spin(args) => spin::run(args),
        Command::Drive(args) => drive::run(args),
        Command::Stop(args) => stop::run(args),
        Command::Ping(args) => ping::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Lamp(args) => lamp::run(args),
        Command::Network(args) => network::run(args),
        Command::Watch(args) => watch::run(args),
        Command::Record(args) => record::run(args),
        Command::Extcap(args) => extcap::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Send(args) => send::run(args),
        #[cfg(unix)]
        Command::Sim(args) => sim::run(args),
        Command::Ports(args) => ports::run(args),
        Command::Bugreport(args) => bugreport::run(args),
        Command::Completions(args) => manual::print_completions(args, description()),
        Command::Man(args) => manual::write_pages(args, description()),
        #[cfg(not(unix))]
        Command::Sim(_) => no_sim::run(),
    }
}
