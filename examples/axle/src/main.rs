//! `axle`: the host tool for Ikeya MD and UCP lines.

use std::process::ExitCode;

fn main() -> ExitCode {
    axle::main()
}
