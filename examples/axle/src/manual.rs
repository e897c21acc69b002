//! `axle completions` and `axle man`: what the tool knows about its own arguments, for shells and
//! for `man`.

use std::{
    fs,
    io::{self, Write},
    path::PathBuf,
};

use clap_complete::Shell;

use crate::{failure::Failure, help::EXIT_CODES};

/// Print the completions for a shell
///
/// For example, for bash: axle completions bash > ~/.local/share/bash-completion/completions/axle
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Write the man pages, one for the tool and one per subcommand
///
/// For example: axle man ~/.local/share/man/man1. Pages that are there are overwritten.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct ManArgs {
    /// The directory; it is created if there is none
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

/// Runs `completions`.
pub(crate) fn print_completions(
    args: &CompletionsArgs,
    mut tool: clap::Command,
) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut tool, "axle", &mut script);
    let mut out = io::stdout().lock();
    out.write_all(&script).and_then(|()| out.flush()).map_err(Failure::Write)
}

/// Runs `man`.
pub(crate) fn write_pages(args: &ManArgs, tool: clap::Command) -> Result<(), Failure> {
    let directory = &args.directory;
    let written =
        fs::create_dir_all(directory).and_then(|()| clap_mangen::generate_to(tool, directory));
    written.map_err(|error| {
        Failure::Failed(format!("cannot write the man pages to {directory:?}: {error}"))
    })
}
