//! Aligned columns for people.

use std::{
    io::{self, Write},
    time::{Duration, SystemTime},
};

use clap::ValueEnum;

use super::{LineClock, Modes, Out, Place, REASONS, Shown, SkippedBytes, pending};
use axlewire::stream::Counters;

/// What the time column shows.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum TimeColumn {
    /// No columns of time and direction
    None,
    /// Seconds since the first line
    Relative,
    /// Seconds since the line before
    Delta,
    /// Date and time of day, UTC
    Absolute,
}

impl TimeColumn {
    const fn width(self) -> usize {
        match self {
            Self::None => 0,
            Self::Relative | Self::Delta => 14,
            Self::Absolute => 27,
        }
    }
}

/// The columns of a listing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    /// Title of the number column: node or index.
    pub(super) number: &'static str,
    pub(super) time: TimeColumn,
}

/// The first time whose date has more columns, microseconds since 1970.
const YEAR_10000: u64 = 253_402_300_800 * 1_000_000;

/// Width of the longest message name.
const NAME_WIDTH: usize = 21;

impl Columns {
    pub(super) fn titles(&self, out: &mut Out) {
        if self.time != TimeColumn::None {
            out.pad(self.time.width() - 4);
            out.text("time  dir  ");
        }
        out.text("    offset  bytes  message                ");
        out.pad(5 - self.number.len());
        out.text(self.number);
        out.text("  contents\n");
    }

    pub(super) fn frame(
        &self,
        out: &mut Out,
        clock: &mut LineClock,
        at: Place,
        frame: &impl Shown,
        modes: &Modes,
    ) {
        self.begin(out, clock, at, frame.bytes().len() as u64, frame.name());
        out.padded(frame.number().into(), 5);
        out.text("  ");
        let end = out.0.len();
        frame.contents(out, modes);
        if out.0.len() == end {
            out.0.truncate(end - 2);
        }
        out.text("\n");
    }

    pub(super) fn gap(&self, out: &mut Out, clock: &mut LineClock, at: Place, gap: &SkippedBytes) {
        self.begin(out, clock, at, gap.length, "(skipped)");
        out.pad(5 + 2);
        out.text(gap.reason.name());
        out.text(": ");
        out.text(gap.reason.meaning());
        out.text("\n");
    }

    /// Columns common to all lines.
    fn begin(&self, out: &mut Out, clock: &mut LineClock, at: Place, length: u64, name: &str) {
        if self.time != TimeColumn::None {
            self.time(out, clock, at.micros);
            out.text("  ");
            let direction = at.direction.map_or("", |direction| direction.name());
            out.text(direction);
            out.pad(3 - direction.len() + 2);
        }
        out.padded(at.offset, 10);
        out.text("  ");
        out.padded(length, 5);
        out.text("  ");
        out.text(name);
        out.pad(NAME_WIDTH.saturating_sub(name.len()) + 2);
    }

    fn time(&self, out: &mut Out, clock: &mut LineClock, micros: Option<u64>) {
        let Some(micros) = micros else { return out.pad(self.time.width()) };
        let first = *clock.first.get_or_insert(micros);
        let last = clock.last.replace(micros).unwrap_or(micros);
        match self.time {
            TimeColumn::None => {}
            TimeColumn::Relative => difference(out, first, micros),
            TimeColumn::Delta => difference(out, last, micros),
            TimeColumn::Absolute if micros < YEAR_10000 => {
                let time = SystemTime::UNIX_EPOCH + Duration::from_micros(micros);
                let text = humantime::format_rfc3339_micros(time).to_string();
                out.text(&text);
            }
            TimeColumn::Absolute => {
                out.padded(micros / 1_000_000, self.time.width() - 2);
                out.text(" s");
            }
        }
    }
}

/// Seconds from one time to another, with sign, in 14 columns.
fn difference(out: &mut Out, from: u64, to: u64) {
    let micros = to.abs_diff(from);
    let mut buffer = itoa::Buffer::new();
    let seconds = buffer.format(micros / 1_000_000);
    let sign = if to < from { "-" } else { "" };
    out.pad(7_usize.saturating_sub(seconds.len() + sign.len()));
    out.text(sign);
    out.text(seconds);
    out.text(".");
    six_digits(out, micros % 1_000_000);
}

/// A number below 1,000,000 with leading zeros.
pub(super) fn six_digits(out: &mut Out, number: u64) {
    let mut digits = *b"000000";
    let mut rest = number;
    for digit in digits.iter_mut().rev() {
        *digit += (rest % 10) as u8;
        rest /= 10;
    }
    out.0.extend_from_slice(&digits);
}

/// Prints the byte counts.
pub(crate) fn print_summary(
    out: &mut impl Write,
    counters: &Counters,
    has_lines: bool,
) -> io::Result<()> {
    let Counters { received, framed, frames, .. } = *counters;
    if received == 0 {
        return writeln!(out, "The input is empty: 0 bytes received, 0 frames.");
    }
    if has_lines {
        writeln!(out)?;
    }
    writeln!(out, "{received:>10} bytes received")?;
    writeln!(out, "{framed:>10} in {frames} {}", if frames == 1 { "frame" } else { "frames" })?;
    write!(out, "{:>10} skipped", counters.skipped())?;
    let mut before = ": ";
    for reason in REASONS {
        let bytes = counters.skipped_for(reason);
        if bytes > 0 {
            write!(out, "{before}{bytes} {reason}")?;
            before = ", ";
        }
    }
    writeln!(out)?;
    let pending = pending(counters);
    if pending > 0 {
        writeln!(out, "{pending:>10} pending")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
