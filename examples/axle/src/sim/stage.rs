//! What the simulations have in common: the line, its events as output, and the end.

use std::{
    fmt::Display,
    io::{self, Write},
    path::{Path, PathBuf},
};

use axlewire::time::Instant;
use serde::Serialize;

use super::{faults::FaultArgs, link::Link, pty::Pty};
use crate::{args, failure::Failure, line::Line, report::Form, signals::Signals};

/// Arguments of every simulation.
#[derive(Debug, clap::Args)]
pub(super) struct StageArgs {
    /// Create a symbolic link to the pseudo-terminal, as a name that stays the same; it is removed
    /// at the end. A link to a pseudo-terminal that no longer exists is replaced
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,

    /// Duration, seconds; by default, until Ctrl-C
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    micros: Option<u64>,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,

    #[command(flatten)]
    faults: FaultArgs,
}

/// A running simulation.
pub(super) struct Stage {
    form: Form,
    end: Option<Instant>,
    faults: FaultArgs,
    is_unplugged: bool,
    signals: Signals,
    _link: Option<Link>,
}

/// An event of the line.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum LineEvent<'a> {
    Pty {
        path: &'a str,
    },
    /// As shown: a path need not be UTF-8.
    Link {
        path: String,
    },
    Unplugged,
    PluggedIn,
}

impl Display for LineEvent<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Pty { path } => write!(f, "pty: {path}"),
            Self::Link { path } => write!(f, "link: {path}"),
            Self::Unplugged => f.write_str("the line is unplugged"),
            Self::PluggedIn => f.write_str("the line is plugged in again"),
        }
    }
}

impl Stage {
    /// Opens the line and prints its path.
    pub(super) fn open(args: &StageArgs) -> Result<(Self, Line), Failure> {
        let signals = Signals::listen()?;
        let (pty, path) = Pty::open(&args.faults)?;
        let link = match &args.link {
            Some(link) => Some(Link::create(link, Path::new(&path))?),
            None => None,
        };
        let stage = Self {
            form: Form::of(args.json),
            end: args.micros.map(Instant::from_micros),
            faults: args.faults.clone(),
            is_unplugged: false,
            signals,
            _link: link,
        };
        print(&stage.form.plain(&LineEvent::Pty { path: &path }))?;
        if let Some(link) = &args.link {
            print(&stage.form.plain(&LineEvent::Link { path: link.display().to_string() }))?;
        }
        Ok((stage, Line::new(&path, pty, true)))
    }

    /// Whether the simulation goes on at `now`. Prints when the line is unplugged and plugged in.
    pub(super) fn goes_on(&mut self, now: Instant) -> Result<bool, Failure> {
        let is_unplugged = self.faults.is_unplugged(now);
        if is_unplugged != self.is_unplugged {
            self.is_unplugged = is_unplugged;
            let event = if is_unplugged { LineEvent::Unplugged } else { LineEvent::PluggedIn };
            self.say(now, &event)?;
        }
        Ok(!self.signals.is_raised() && self.end.is_none_or(|end| now < end))
    }

    /// Prints an event.
    pub(super) fn say(
        &self,
        now: Instant,
        event: &(impl Display + Serialize),
    ) -> Result<(), Failure> {
        print(&self.form.line(now.as_micros(), event))
    }
}

fn print(line: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(Failure::Write)
}
