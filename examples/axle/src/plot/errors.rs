//! What went wrong, as rows of ticks.

use std::collections::BTreeMap;

use super::{
    columns::Columns,
    line::Line,
    picture::{ERROR, Look, Panel, Series, Size, colour},
};

/// A row of ticks. In the order of the picture.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Row {
    /// A poll of this node without an answer before the next request.
    Silent(u8),
    /// An answer of this node behind the next request.
    Late(u8),
    /// An answer of this node that nobody had asked for.
    Stray(u8),
    /// A speed of this node that is no number (ruling I4).
    Nan(u8),
    /// Reports missing in the count of their indices (ruling U9).
    Lost,
    /// The other side says that a frame arrived damaged (ruling U12).
    Refused,
    Crc,
    Header,
    Length,
    Id,
    Idle,
}

/// All rows that have a tick.
#[derive(Debug, Default)]
pub(super) struct Errors(BTreeMap<Row, Columns>);

impl Errors {
    fn put(&mut self, row: Row, x: u64) {
        self.0.entry(row).or_default().push(x, 1.0);
    }

    pub(super) fn silent(&mut self, node: u8, x: u64) {
        self.put(Row::Silent(node), x);
    }

    pub(super) fn late(&mut self, node: u8, x: u64) {
        self.put(Row::Late(node), x);
    }

    pub(super) fn nan(&mut self, node: u8, x: u64) {
        self.put(Row::Nan(node), x);
    }

    pub(super) fn stray(&mut self, node: u8, x: u64) {
        self.put(Row::Stray(node), x);
    }

    /// That many reports are missing in front of this one.
    pub(super) fn lost(&mut self, reports: u8, x: u64) {
        (0..reports).for_each(|_| self.put(Row::Lost, x));
    }

    pub(super) fn refused(&mut self, x: u64) {
        self.put(Row::Refused, x);
    }

    /// Bytes that belong to no frame: in the row of a bad CRC if there is one among the reasons,
    /// otherwise in that of the first.
    pub(super) fn gap(&mut self, line: &Line<'_>, x: u64) {
        let row = match line.reason {
            "crc" => Row::Crc,
            _ if line.reasons.contains_key("crc") => Row::Crc,
            "header" => Row::Header,
            "length" => Row::Length,
            "id" => Row::Id,
            "idle" => Row::Idle,
            _ => return,
        };
        self.put(row, x);
    }

    pub(super) fn panel(self) -> Panel {
        let series = self.0.into_iter().map(|(row, columns)| {
            let (name, colour) = match row {
                Row::Silent(node) => (format!("node {node} silent"), colour(node)),
                Row::Late(node) => (format!("node {node} late"), colour(node)),
                Row::Stray(node) => (format!("node {node} unasked"), colour(node)),
                Row::Nan(node) => (format!("node {node} NaN"), colour(node)),
                Row::Lost => ("report lost".to_owned(), 1),
                Row::Refused => ("refused".to_owned(), 3),
                Row::Crc => ("bad CRC".to_owned(), ERROR),
                Row::Header => ("no header".to_owned(), ERROR),
                Row::Length => ("bad length".to_owned(), ERROR),
                Row::Id => ("bad id".to_owned(), ERROR),
                Row::Idle => ("cut off".to_owned(), ERROR),
            };
            Series { name, look: Look::Ticks, colour, is_named: false, columns }
        });
        Panel {
            title: "Errors",
            unit: "",
            size: Size::Rows,
            least: None,
            series: series.collect(),
            hint: "a tick each; how many, on the right",
        }
    }
}
