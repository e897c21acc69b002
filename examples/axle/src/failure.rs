//! Failures, each with a one-line message and an exit code.

use core::fmt;
use std::{
    io::{self, Write},
    panic,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anstyle::{AnsiColor, Effects, Style};
use clap::error::{ContextKind, ContextValue};

use crate::freely::freely;

const ERROR: Style = AnsiColor::Red.on_default().effects(Effects::BOLD);

/// Reason why the tool exits early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line is wrong.
    Usage(String),
    /// The file cannot be opened.
    Open { path: PathBuf, error: io::Error },
    /// Reading the input failed; `None` is standard input.
    Read { path: Option<PathBuf>, error: io::Error },
    /// Writing the output failed.
    Write(io::Error),
    /// The port failed after it was opened; `moving` is the consequence for a moving motor or
    /// rover.
    PortLost { path: String, cause: String, moving: Option<String> },
    /// The operation failed.
    Failed(String),
}

impl Failure {
    /// The file or folder cannot be created.
    pub(crate) fn cannot_create(path: &Path, error: &io::Error) -> Self {
        let hint = match error.kind() {
            io::ErrorKind::AlreadyExists => ": remove it first, or choose another name",
            _ => "",
        };
        Self::Failed(format!("cannot create {path:?}: {error}{hint}"))
    }

    /// This build cannot do it.
    #[cfg_attr(all(feature = "mcap", feature = "parquet", feature = "plot"), allow(dead_code))]
    pub(crate) fn without_feature(feature: &str) -> Self {
        let line = "this axle was built without the feature";
        Self::Usage(format!("{line} {feature}: build it with --features {feature}"))
    }

    /// The first paragraph of clap's message on one line, with the likely intention; --help
    /// shows usage and tips.
    pub(crate) fn usage(error: &clap::Error) -> Self {
        let text = error.render().to_string();
        let paragraph = text.split("\n\n").next().unwrap_or_default();
        let words: Vec<_> = paragraph.split_whitespace().collect();
        let line = words.join(" ");
        let line = line.strip_prefix("error: ").unwrap_or(&line);
        let suggestions = [
            ContextKind::SuggestedSubcommand,
            ContextKind::SuggestedArg,
            ContextKind::SuggestedValue,
        ];
        let suggestion = suggestions.into_iter().find_map(|kind| match error.get(kind)? {
            ContextValue::String(one) => Some(one.clone()),
            // The best one is the last.
            ContextValue::Strings(several) => several.last().cloned(),
            _ => None,
        });
        Self::Usage(match suggestion {
            Some(suggestion) => format!("{line}; did you mean '{suggestion}'?"),
            None => line.to_owned(),
        })
    }

    /// A port that failed after it was opened.
    pub(crate) fn lost(path: &str, cause: &str) -> Self {
        Self::PortLost { path: path.to_owned(), cause: cause.to_owned(), moving: None }
    }

    /// Adds the consequence for what is moving, if the port was lost.
    pub(crate) fn while_moving(self, consequence: &str) -> Self {
        match self {
            Self::PortLost { path, cause, .. } => {
                Self::PortLost { path, cause, moving: Some(consequence.to_owned()) }
            }
            other => other,
        }
    }

    /// Names the file that it is about.
    pub(crate) fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Failed(line) => Self::Failed(format!("{path:?}: {line}")),
            other => other,
        }
    }

    /// Adds `besides` to the message of a failed operation, or of a port that was lost.
    pub(crate) fn and(self, besides: &str) -> Self {
        match self {
            Self::Failed(line) => Self::Failed(format!("{line}; {besides}")),
            lost @ Self::PortLost { moving: None, .. } => lost.while_moving(besides),
            other => other,
        }
    }

    /// Prints the message and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        match self {
            // `axle ... | head`: the reader has seen enough; this is not an error.
            Self::Write(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                return ExitCode::SUCCESS;
            }
            // If standard error is closed, there is nowhere left to report.
            _ => drop(freely(|| writeln!(anstream::stderr(), "{ERROR}axle:{ERROR:#} {self}"))),
        }
        match self {
            Self::Usage(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }
}

/// Runs what moves something: if it panics, that is a failure like others, so that the caller stops
/// what moves. The panic's own message has gone to standard error.
pub(crate) fn guarded<T>(run: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    let bug = |_| Err(Failure::Failed("the tool has a bug and gave up".to_owned()));
    panic::catch_unwind(panic::AssertUnwindSafe(run)).unwrap_or_else(bug)
}

/// Control characters in paths are escaped, so that the message stays on one line.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(line) | Self::Failed(line) => f.write_str(line),
            Self::Open { path, error } => write!(f, "cannot open {path:?}: {error}"),
            Self::Read { path: Some(path), error } => write!(f, "cannot read {path:?}: {error}"),
            Self::Read { path: None, error } => write!(f, "cannot read standard input: {error}"),
            Self::Write(error) => write!(f, "cannot write the output: {error}"),
            Self::PortLost { path, cause, moving: None } => {
                write!(f, "port {path:?} failed: {cause}")
            }
            Self::PortLost { path, cause, moving: Some(consequence) } => {
                write!(f, "port {path:?} failed: {cause}; {consequence}")
            }
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::{Failure, guarded};
    use crate::report::{Form, Outcome};

    #[test]
    fn a_failure_is_told_with_what_is_known_besides() {
        let lost = || Failure::lost("port", "unplugged");
        let failed = || Failure::Failed("too slow".to_owned());
        assert_eq!(failed().and("at rest").to_string(), "too slow; at rest");
        assert_eq!(lost().and("at rest").to_string(), "port \"port\" failed: unplugged; at rest");
        let moving = lost().while_moving("it turns");
        let says = "port \"port\" failed: unplugged; it turns";
        assert_eq!(moving.to_string(), says);
        assert_eq!(moving.and("at rest").to_string(), says, "the worse one stays");
        assert_eq!(failed().while_moving("it turns").to_string(), "too slow");
        let outcome = |result| {
            let (teller, lines) = crate::teller::Teller::to_memory();
            let mut teller = teller;
            Outcome::of(&result, result.is_ok()).say(Form::Json, &mut teller);
            Outcome::of(&result, false).say(Form::Text, &mut teller);
            teller.finish().unwrap();
            lines.lock().unwrap().concat()
        };
        let says = r#"{"event":"outcome","at_rest":false,"failure":"too slow"}"#;
        assert_eq!(outcome(Err(failed())), says);
        assert_eq!(outcome(Ok(())), r#"{"event":"outcome","at_rest":true}"#);
    }

    #[test]
    fn a_panic_is_a_failure_so_that_what_moves_is_stopped() {
        assert_eq!(guarded(|| Ok(1)).unwrap(), 1);
        let failure = guarded(|| -> Result<(), Failure> { panic!("planted") }).unwrap_err();
        assert_eq!(failure.to_string(), "the tool has a bug and gave up");
    }
}
