//! What can go wrong: one line and an exit code each.

use core::fmt;
use std::{
    io::{self, Write},
    path::PathBuf,
    process::ExitCode,
};

/// Why the tool ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line is wrong.
    Usage(String),
    /// The file cannot be opened.
    Open { path: PathBuf, error: io::Error },
    /// The file is a directory.
    Directory { path: PathBuf },
    /// The input broke off; `None` is standard input.
    Read { path: Option<PathBuf>, error: io::Error },
    /// The output broke off.
    Write(io::Error),
    /// The port cannot be used.
    Port { path: String, cause: String },
    /// The port was good and is no more; what that means for what moves, if anything does.
    PortLost { path: String, cause: String, moving: Option<String> },
    /// What was to be done did not come about.
    Undone(String),
}

impl Failure {
    /// The first paragraph of clap's answer in one line; usage and tips are what --help is for.
    pub(crate) fn usage(error: &clap::Error) -> Self {
        let text = error.render().to_string();
        let paragraph = text.split("\n\n").next().unwrap_or_default();
        let words: Vec<_> = paragraph.split_whitespace().collect();
        let line = words.join(" ");
        Self::Usage(line.strip_prefix("error: ").unwrap_or(&line).to_owned())
    }

    /// The same, happening while something moves: a lost port then says what becomes of that.
    pub(crate) fn while_moving(self, consequence: &str) -> Self {
        match self {
            Self::PortLost { path, cause, .. } => {
                Self::PortLost { path, cause, moving: Some(consequence.to_owned()) }
            }
            other => other,
        }
    }

    /// The same, where what was to be done did not come about, with what is known besides.
    pub(crate) fn and(self, besides: &str) -> Self {
        match self {
            Self::Undone(line) => Self::Undone(format!("{line}; {besides}")),
            other => other,
        }
    }

    /// Tells the user, and gives the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        match self {
            // `axle ... | head`: the reader has seen enough, nothing is wrong.
            Self::Write(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                return ExitCode::SUCCESS;
            }
            // Where standard error is closed there is nobody left to tell.
            _ => drop(writeln!(io::stderr(), "axle: {self}")),
        }
        match self {
            Self::Usage(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }
}

/// Paths are printed with their control characters escaped, so that one line stays one line.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(line) | Self::Undone(line) => f.write_str(line),
            Self::Open { path, error } => write!(f, "cannot open {path:?}: {error}"),
            Self::Directory { path } => write!(f, "cannot read {path:?}: it is a directory"),
            Self::Read { path: Some(path), error } => write!(f, "cannot read {path:?}: {error}"),
            Self::Read { path: None, error } => write!(f, "cannot read standard input: {error}"),
            Self::Write(error) => write!(f, "cannot write the output: {error}"),
            Self::Port { path, cause } => write!(f, "cannot use port {path:?}: {cause}"),
            Self::PortLost { path, cause, moving: None } => {
                write!(f, "port {path:?} has failed: {cause}")
            }
            Self::PortLost { path, cause, moving: Some(consequence) } => {
                write!(f, "port {path:?} has failed: {cause}; {consequence}")
            }
        }
    }
}
