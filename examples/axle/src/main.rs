//! `axle`: the host tool for Ikeya MD and UCP lines.

use std::{env, process::ExitCode};

fn main() -> ExitCode {
    axle::run_with(env::args_os())
}
