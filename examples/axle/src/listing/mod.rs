//! Frames and gaps as lines: for people, or as JSON.

mod json;
mod row;
mod shown;
mod table;

use std::fmt;

use axlewire::stream::{Counters, Reason};

use crate::pcapng::Direction;
pub(crate) use json::{seconds, summary as json_summary};
pub(crate) use row::{TimeColumn, print_summary};
pub(crate) use shown::{Modes, Shown};
pub(crate) use table::Table;

/// Where and when an event was on the line.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// Offset of its first byte in the bytes of its interface and direction.
    pub(crate) offset: u64,
    /// When its last byte had been received, microseconds since 1970; `None` if the capture has no
    /// times.
    pub(crate) micros: Option<u64>,
    pub(crate) direction: Option<Direction>,
    /// The interface, if the capture has such.
    pub(crate) interface: Option<usize>,
}

/// A run of bytes that belong to no frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkippedBytes {
    pub(crate) length: u64,
    /// Why its first byte was skipped.
    pub(crate) reason: Reason,
    /// The account of all its bytes.
    pub(crate) account: Counters,
}

/// All reasons, in the order in which they are printed.
pub(crate) const REASONS: [Reason; 5] =
    [Reason::Header, Reason::Length, Reason::Id, Reason::Crc, Reason::Idle];

/// Number of bytes that are in no other count: they may still become a frame (ruling B2).
const fn pending(counters: &Counters) -> u64 {
    counters.received - counters.framed - counters.skipped()
}

/// The form of the lines.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Style {
    Json,
    Text(row::Columns),
}

impl Style {
    /// Aligned columns. `number` is the title of the number column: node or index.
    pub(crate) const fn text(number: &'static str, time: TimeColumn) -> Self {
        Self::Text(row::Columns { number, time })
    }

    /// The titles of the columns.
    pub(crate) fn titles(&self, out: &mut Out) {
        if let Self::Text(columns) = self {
            columns.titles(out);
        }
    }

    /// Appends the line of a frame. `mode` is that of its node, where it is known.
    pub(crate) fn frame(
        &self,
        out: &mut Out,
        clock: &mut LineClock,
        at: Place,
        frame: &impl Shown,
        modes: &Modes,
    ) {
        match self {
            Self::Json => json::frame(out, at, frame, modes),
            Self::Text(columns) => columns.frame(out, clock, at, frame, modes),
        }
    }

    /// Appends the line of a gap.
    pub(crate) fn gap(&self, out: &mut Out, clock: &mut LineClock, at: Place, gap: &SkippedBytes) {
        match self {
            Self::Json => json::gap(out, at, gap),
            Self::Text(columns) => columns.gap(out, clock, at, gap),
        }
    }
}

/// What the time column counts from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LineClock {
    first: Option<u64>,
    last: Option<u64>,
}

/// Lines that are collected before they are written.
#[derive(Debug, Default)]
pub(crate) struct Out(pub(crate) Vec<u8>);

impl Out {
    pub(crate) fn text(&mut self, text: &str) {
        self.0.extend_from_slice(text.as_bytes());
    }

    pub(crate) fn number(&mut self, number: u64) {
        self.text(itoa::Buffer::new().format(number));
    }

    /// A number, right-aligned.
    pub(crate) fn padded(&mut self, number: u64, width: usize) {
        let mut buffer = itoa::Buffer::new();
        let digits = buffer.format(number);
        self.pad(width.saturating_sub(digits.len()));
        self.text(digits);
    }

    pub(crate) fn pad(&mut self, count: usize) {
        self.0.resize(self.0.len() + count, b' ');
    }
}

impl fmt::Write for Out {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.text(text);
        Ok(())
    }
}
