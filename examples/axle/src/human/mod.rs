//! The human-readable listing: aligned columns, with units.

mod ikeya;
mod ucp;

use core::fmt;
use std::io::{self, Write};

use axlewire::stream::Reason;

use crate::record::{Frame, Record, Summary};

/// State of a listing.
#[derive(Debug)]
pub(crate) struct Listing {
    /// Title of the number column: node or index.
    number: &'static str,
    titled: bool,
}

impl Listing {
    pub(crate) const fn new(number: &'static str) -> Self {
        Self { number, titled: false }
    }

    /// Prints one record, with the titles before the first event.
    pub(crate) fn print(&mut self, out: &mut impl Write, record: &Record<'_>) -> io::Result<()> {
        if let Record::Summary(summary) = record {
            return print_summary(out, summary, self.titled);
        }
        if !self.titled {
            self.titled = true;
            row(out, &"offset", &"bytes", "message", &self.number)?;
            writeln!(out, "  contents")?;
        }
        match record {
            Record::Frame { offset, frame } => print_frame(out, *offset, frame),
            Record::Skipped { offset, length, reason } => {
                row(out, offset, length, "(skipped)", &"")?;
                writeln!(out, "  {reason}: {}", explain(*reason))
            }
            Record::Summary(_) => Ok(()),
        }
    }
}

fn print_frame(out: &mut impl Write, offset: u64, frame: &Frame<'_>) -> io::Result<()> {
    match frame {
        Frame::Ikeya(frame) => {
            row(out, &offset, &frame.length, frame.message, &frame.node)?;
            ikeya::contents(out, &frame.fields)?;
        }
        Frame::Ucp(frame) => {
            row(out, &offset, &frame.length, frame.message, &frame.index)?;
            ucp::contents(out, frame.id, &frame.fields)?;
        }
    }
    writeln!(out)
}

/// Contents of a frame, without its name.
pub(crate) fn contents(frame: &Frame<'_>) -> String {
    let mut text = Vec::new();
    let written = match frame {
        Frame::Ikeya(frame) => ikeya::contents(&mut text, &frame.fields),
        Frame::Ucp(frame) => ucp::contents(&mut text, frame.id, &frame.fields),
    };
    written.map_or_else(|_| String::new(), |()| String::from_utf8_lossy(&text).trim().to_owned())
}

/// Columns common to all lines; the longest message name has 21 characters.
fn row(
    out: &mut impl Write,
    offset: &dyn fmt::Display,
    length: &dyn fmt::Display,
    message: &str,
    number: &dyn fmt::Display,
) -> io::Result<()> {
    write!(out, "{offset:>10}  {length:>5}  {message:<21}  {number:>5}")
}

const fn explain(reason: Reason) -> &'static str {
    match reason {
        Reason::Header => "no frame starts here",
        Reason::Length => "invalid length",
        Reason::Id => "invalid node id",
        Reason::Crc => "damaged, or not a frame",
        Reason::Idle => "truncated at the end",
        _ => "no frame",
    }
}

/// Prints the byte counts.
pub(crate) fn print_summary(
    out: &mut impl Write,
    summary: &Summary,
    events: bool,
) -> io::Result<()> {
    let Summary { received, framed, skipped, pending, frames, counters } = summary;
    if *received == 0 {
        return writeln!(out, "The input is empty: 0 bytes received, 0 frames.");
    }
    if events {
        writeln!(out)?;
    }
    writeln!(out, "{received:>10} bytes received")?;
    writeln!(out, "{framed:>10} in {frames} {}", if *frames == 1 { "frame" } else { "frames" })?;
    write!(out, "{skipped:>10} skipped")?;
    let reasons = [Reason::Header, Reason::Length, Reason::Id, Reason::Crc, Reason::Idle];
    let mut before = ": ";
    for reason in reasons {
        let bytes = counters.skipped_for(reason);
        if bytes > 0 {
            write!(out, "{before}{bytes} {reason}")?;
            before = ", ";
        }
    }
    writeln!(out)?;
    if *pending > 0 {
        writeln!(out, "{pending:>10} pending")?;
    }
    Ok(())
}

/// Values separated by spaces.
struct Spaced<'a, T>(&'a [T]);

impl<T: fmt::Display> fmt::Display for Spaced<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        spaced(self.0, f, T::fmt)
    }
}

impl<T: fmt::Debug> fmt::Debug for Spaced<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        spaced(self.0, f, T::fmt)
    }
}

/// Width and precision of `f` apply to each value.
fn spaced<T>(
    values: &[T],
    f: &mut fmt::Formatter<'_>,
    write: fn(&T, &mut fmt::Formatter<'_>) -> fmt::Result,
) -> fmt::Result {
    for (at, value) in values.iter().enumerate() {
        if at > 0 {
            f.write_str(" ")?;
        }
        write(value, f)?;
    }
    Ok(())
}
