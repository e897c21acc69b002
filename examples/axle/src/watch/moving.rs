//! `--page` of the subcommands that move something.

#[cfg(all(unix, feature = "dashboard"))]
use axlewire::{
    ikeya::{self, three},
    ucp,
};

#[cfg(all(unix, feature = "dashboard"))]
use super::live::Live;
use crate::{args::Protocol, failure::Failure, line::Line, signals::Signals};

/// Message of a build without the page.
#[cfg(not(all(unix, feature = "dashboard")))]
pub(super) const NO_PAGE: &str =
    "this build has no page; on Unix, build it with --features dashboard";

#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct PageArgs {
    /// Show the page of axle watch meanwhile; space, s, q and Esc stop at once, as Ctrl-C does
    #[arg(long, conflicts_with = "json")]
    page: bool,
}

/// The page, if it was requested.
#[derive(Default)]
pub(crate) struct Page {
    #[cfg(all(unix, feature = "dashboard"))]
    live: Option<Live>,
}

/// What the page shows of its line.
#[cfg_attr(
    not(all(unix, feature = "dashboard")),
    expect(dead_code, reason = "there is no page to say it")
)]
pub(crate) struct About {
    pub(crate) command: &'static str,
    pub(crate) protocol: Protocol,
    pub(crate) baud: u32,
}

impl PageArgs {
    /// Shows the page, if it was requested; use the returned line from now on.
    #[cfg(all(unix, feature = "dashboard"))]
    pub(crate) fn open(
        self,
        line: Line,
        about: &About,
        signals: &Signals,
    ) -> Result<(Page, Line), Failure> {
        if !self.page {
            return Ok((Page::default(), line));
        }
        let About { command, protocol, baud } = *about;
        let open = match protocol {
            Protocol::Ucp => Live::open::<ucp::Ucp>,
            Protocol::Ikeya => Live::open::<ikeya::BothDirections>,
            Protocol::Ikeya3 => Live::open::<three::BothDirections>,
        };
        let live = open(command, line.path(), protocol, baud, signals)?;
        let line = live.tap(line);
        Ok((Page { live: Some(live) }, line))
    }

    /// There is no page.
    #[cfg(not(all(unix, feature = "dashboard")))]
    pub(crate) fn open(self, line: Line, _: &About, _: &Signals) -> Result<(Page, Line), Failure> {
        if self.page {
            return Err(Failure::Usage(NO_PAGE.to_owned()));
        }
        Ok((Page::default(), line))
    }
}

#[cfg(all(unix, feature = "dashboard"))]
impl Page {
    /// Adds a line to the page, or returns it if there is none.
    pub(crate) fn note(&self, line: String) -> Option<String> {
        match &self.live {
            Some(live) => live.note(line),
            None => return Some(line),
        }
        None
    }

    /// Shows that what moves was told to stop.
    pub(crate) fn stopping(&self) {
        self.live.iter().for_each(Live::stopping);
    }

    /// Leaves the page, so that lines can be printed again.
    pub(crate) fn leave(&mut self) -> Result<(), Failure> {
        self.live.take().map_or(Ok(()), |mut live| live.leave())
    }
}

#[cfg(all(test, unix, feature = "dashboard"))]
impl Page {
    /// A page that has given up.
    pub(crate) fn that_gave_up() -> Self {
        Self { live: Some(Live::that_gave_up()) }
    }
}

#[cfg(not(all(unix, feature = "dashboard")))]
impl Page {
    /// There is no page for this line.
    pub(crate) fn note(&self, line: String) -> Option<String> {
        Some(line)
    }

    pub(crate) fn stopping(&self) {}

    pub(crate) fn leave(&mut self) -> Result<(), Failure> {
        Ok(())
    }
}
