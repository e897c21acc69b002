//! `axle sim`: simulates motors or a rover on a pseudo-terminal.

mod ikeya;
mod pty;
mod ucp;

use std::io::{self, Write};

use axlewire::time::Instant;

use crate::{EXIT_CODES, failure::Failure};

/// Simulate motors or a rover on a pseudo-terminal
///
/// The first line of the output is `pty: PATH`: use that path as the --port of another program. The
/// following lines show what happens, until Ctrl-C.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES, arg_required_else_help = false)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Ikeya(ikeya::Args),
    Ucp(ucp::Args),
}

/// Faults of the line.
#[derive(Clone, Copy, Debug, clap::Args)]
struct Faults {
    /// Bit error rate in both directions, from 0 (none) to 1 (all); 1e-4 is one in 10,000
    #[arg(long, value_name = "RATE", default_value = "0", value_parser = rate)]
    noise: f64,

    /// Seed of the noise: the same seed and the same bytes give the same bit errors
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=1.0).contains(&rate) { Ok(rate) } else { Err(format!("{rate} is not within 0..=1")) }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.what {
        What::Ikeya(args) => ikeya::run(args),
        What::Ucp(args) => ucp::run(args),
    }
}

/// Prints one line with a timestamp.
fn say(now: Instant, what: &str) -> Result<(), Failure> {
    let seconds = now.as_micros() as f64 / 1e6;
    let mut out = io::stdout().lock();
    writeln!(out, "{seconds:8.2} s  {what}").and_then(|()| out.flush()).map_err(Failure::Write)
}
