//! What is drawn, whatever it is drawn on: panels above each other with one axis.

use super::columns::Columns;

/// A picture of a capture.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) title: String,
    pub(super) axis: Axis,
    pub(super) panels: Vec<Panel>,
    /// What a reader has to know besides.
    pub(super) notes: Vec<String>,
}

/// What the axis of all panels counts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) title: String,
    pub(super) unit: &'static str,
    /// The place that is 0.
    pub(super) origin: u64,
    /// Places per unit.
    pub(super) per_unit: f64,
    /// The last place.
    pub(super) end: u64,
}

impl Axis {
    /// A place in units.
    pub(super) fn of(&self, place: u64) -> f64 {
        place.saturating_sub(self.origin) as f64 / self.per_unit
    }

    /// Its length in units.
    pub(super) fn span(&self) -> f64 {
        self.of(self.end).max(1e-6)
    }
}

/// Curves with one unit.
#[derive(Debug)]
pub(super) struct Panel {
    pub(super) title: &'static str,
    pub(super) unit: &'static str,
    pub(super) size: Size,
    /// What the axis shows at least.
    pub(super) least: Option<(f64, f64)>,
    pub(super) series: Vec<Series>,
    /// A word on what the curves mean.
    pub(super) hint: &'static str,
}

/// How much room a panel has.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Size {
    Tall,
    Low,
    /// Two of them are side by side.
    Half,
    /// A row for each series.
    Rows,
}

/// A curve.
#[derive(Debug)]
pub(super) struct Series {
    pub(super) name: String,
    pub(super) look: Look,
    /// Number in the palette.
    pub(super) colour: usize,
    /// Whether the legend names it; what has no name there has the colour of one that has.
    pub(super) is_named: bool,
    pub(super) columns: Columns,
}

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Look {
    /// Measured: a line from value to value.
    Line,
    /// The same, wide and pale behind the others.
    Wide,
    /// Commanded: holds until the next, a wide pale line behind the others.
    Held,
    /// Commanded, in a panel of its own.
    Step,
    Dots,
    /// Events: a tick each.
    Ticks,
}

impl Look {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Wide => "wide",
            Self::Held => "held",
            Self::Step => "step",
            Self::Dots => "dots",
            Self::Ticks => "ticks",
        }
    }
}

/// Colours that people with any colour blindness tell apart, after Okabe and Ito, with a yellow
/// that is seen on white; the last is for errors of no node.
pub(super) const PALETTE: [(u8, u8, u8); 9] = [
    (0x00, 0x72, 0xB2),
    (0xE0, 0x8E, 0x00),
    (0x00, 0x9E, 0x73),
    (0xCC, 0x79, 0xA7),
    (0x56, 0xB4, 0xE9),
    (0xD5, 0x5E, 0x00),
    (0x9A, 0x8F, 0x00),
    (0x4A, 0x4A, 0x4A),
    (0xB3, 0x00, 0x21),
];

/// The colour of errors.
pub(super) const ERROR: usize = 8;

/// The colour of a node, 1 to 8.
pub(super) fn colour(node: u8) -> usize {
    usize::from(node.saturating_sub(1)) % ERROR
}

/// A smaller difference, as a part of the values or of 1, is drawn as none.
const LEAST: f64 = 1e-12;

impl Panel {
    /// Lowest and highest value to be shown, with some room.
    pub(super) fn range(&self) -> (f64, f64) {
        let ranges = self.series.iter().filter_map(|series| series.columns.range());
        let all = ranges
            .chain(self.least)
            .reduce(|(low, high), (lower, higher)| (low.min(lower), high.max(higher)));
        let (low, high) = all.unwrap_or((0.0, 1.0));
        let least = high.abs().max(low.abs()).max(1.0) * LEAST;
        let room = match high - low {
            span if span < least => (high.abs() * 0.1).max(1.0),
            span => span * 0.06,
        };
        let is_end =
            |end: fn(&(f64, f64)) -> f64, value| self.least.as_ref().map(end) == Some(value);
        let below = if is_end(|(low, _)| *low, low) && low < high { 0.0 } else { room };
        (low - below, high + room)
    }
}
