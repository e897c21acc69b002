//! Runs the host tool, with what its own tests have for that.

#[path = "../../../axle/tests/support/process.rs"]
#[allow(dead_code, reason = "the tests of the tool use more of it")]
pub(crate) mod process;

use std::{path::Path, process::Command, sync::Once};

/// The tool with these arguments. It belongs to another package, so it is built first.
pub(crate) fn axle(args: &[&str]) -> Command {
    static BUILT: Once = Once::new();
    BUILT.call_once(|| {
        let build =
            Command::new(env!("CARGO")).args(["build", "--quiet", "-p", "axlewire-cli"]).status();
        assert!(build.unwrap().success());
    });
    let mut command = Command::new(Path::new(env!("CARGO_BIN_EXE_spin")).with_file_name("axle"));
    command.args(args);
    command
}
