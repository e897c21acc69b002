//! Frames and gaps as lines: for people, or as JSON.

mod event;
mod json;
mod out;
mod row;
mod shown;
mod table;

pub(crate) use event::{LineClock, Place, REASONS, SkippedBytes, pending};
pub(crate) use json::{seconds, summary as json_summary};
pub(crate) use out::Out;
pub(crate) use row::{TimeColumn, print_summary};
pub(crate) use shown::{Hot, Modes, Shown};
pub(crate) use table::Table;

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
