//! The lines of a listing on standard output.

use std::io::{self, Write};

use axlewire::stream::Counters;

use super::Sheet;
use crate::{
    failure::Failure,
    listing::{self, Style},
};

/// Writes lines to standard output, with the titles in front of the first and the summary behind
/// the last.
pub(super) struct Printer {
    out: io::BufWriter<io::StdoutLock<'static>>,
    is_json: bool,
    style: Option<Style>,
    has_lines: bool,
}

impl Printer {
    pub(super) fn new(is_json: bool, style: Option<Style>) -> Self {
        let out = io::BufWriter::with_capacity(64 * 1024, io::stdout().lock());
        Self { out, is_json, style, has_lines: false }
    }

    pub(super) fn print(&mut self, lines: &[u8]) -> Result<(), Failure> {
        if lines.is_empty() {
            return Ok(());
        }
        if !self.has_lines {
            self.has_lines = true;
            let mut titles = listing::Out::default();
            if let Some(style) = &self.style {
                style.titles(&mut titles);
            }
            self.out.write_all(&titles.0).map_err(Failure::Write)?;
        }
        self.out.write_all(lines).map_err(Failure::Write)
    }

    /// Prints the lines of a sheet, and empties it.
    pub(super) fn print_sheet(&mut self, sheet: &mut Sheet) -> Result<(), Failure> {
        self.print(&sheet.out.0)?;
        sheet.out.0.clear();
        Ok(())
    }

    pub(super) fn flush(&mut self) -> Result<(), Failure> {
        self.out.flush().map_err(Failure::Write)
    }

    /// Ends a listing that could not be finished: what was decoded is still valid, and the missing
    /// summary shows that it is incomplete. With `--summary`, the summary is all there is.
    pub(super) fn break_off(mut self, account: &Counters, times_back: u64) -> Result<(), Failure> {
        match self.style {
            None if account.received > 0 => self.finish(account, times_back),
            _ => self.flush(),
        }
    }

    pub(super) fn finish(mut self, account: &Counters, times_back: u64) -> Result<(), Failure> {
        let printed = if self.is_json {
            let mut line = listing::Out::default();
            listing::json_summary(&mut line, account, times_back);
            self.out.write_all(&line.0)
        } else {
            listing::print_summary(&mut self.out, account, self.has_lines).and_then(|()| {
                match times_back {
                    0 => Ok(()),
                    times => writeln!(self.out, "{times:>10} times the clock went backwards"),
                }
            })
        };
        printed.map_err(Failure::Write)?;
        self.flush()
    }
}
