//! The rows of a capture that stays in memory, for programs that show any of them at any time.
//!
//! Made for the page of `examples/web`. It changes with the tool, without notice.

use std::ops::Range;

use axlewire::ikeya::NodeId;

pub use crate::tables::{Column, Values};
use crate::{
    decode::{self, Sheet},
    failure::Failure,
    kept::{Is, Kept},
    listing::{Modes, Style},
    tables::{self, Sink, Table, Tables, csv},
};

/// Frames and gaps in their order.
#[derive(Debug)]
pub struct Rows {
    kept: Kept,
    has_times: bool,
    /// The names of the tables, by kind.
    names: Vec<String>,
}

impl Rows {
    pub(crate) fn new(kept: Kept, has_times: bool) -> Self {
        let name = |&(protocol, message): &_| tables::name(protocol, message);
        Self { has_times, names: kept.kinds().iter().map(name).collect(), kept }
    }

    /// How many there are.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "a capture without rows is refused")]
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether they have times.
    #[must_use]
    pub const fn has_times(&self) -> bool {
        self.has_times
    }

    /// The tables that rows are of, such as `ucp.report`; `skipped` for the gaps.
    #[must_use]
    pub fn tables(&self) -> &[String] {
        &self.names
    }

    /// The table of a row: its number among [`tables`](Self::tables).
    #[must_use]
    pub fn table(&self, row: usize) -> Option<usize> {
        self.kept.kind(row)
    }

    /// Offset and bytes of a row; of a gap, no bytes.
    #[must_use]
    pub fn bytes(&self, row: usize) -> Option<(u64, &[u8])> {
        self.kept.get(row).map(|(at, is)| match is {
            Is::Frame(_, bytes, _) => (at.offset, bytes),
            Is::Gap(_) => (at.offset, &[][..]),
        })
    }

    /// The lines of `axle decode --json` of these rows.
    pub fn lines(&self, rows: impl IntoIterator<Item = usize>) -> Vec<u8> {
        let mut sheet = Sheet::new(Some(Style::Json));
        rows.into_iter().for_each(|row| self.list(row, &mut sheet));
        sheet.out.0
    }

    /// Of these rows, those of which the line has this text; upper and lower case of ASCII are
    /// alike.
    #[must_use]
    pub fn with_text(&self, rows: impl IntoIterator<Item = usize>, text: &str) -> Vec<usize> {
        let text = text.to_ascii_lowercase();
        let mut sheet = Sheet::new(Some(Style::Json));
        let has_text = |row: &usize| {
            sheet.out.0.clear();
            self.list(*row, &mut sheet);
            sheet.out.0.make_ascii_lowercase();
            str::from_utf8(&sheet.out.0).is_ok_and(|line| line.contains(&text))
        };
        rows.into_iter().filter(has_text).collect()
    }

    /// The columns of a table, without rows.
    #[must_use]
    pub fn columns(&self, table: usize) -> Vec<Column> {
        let name = self.names.get(table);
        let tables = Tables::new(self.has_times, false).into_tables();
        tables.into_iter().find(|it| Some(&it.name) == name).map_or_else(Vec::new, |it| it.columns)
    }

    /// Hands over a table in pieces: all columns, and how many rows they have. `rows` are numbers
    /// among those of the table.
    pub fn each_piece(&self, table: usize, rows: Range<usize>, each: impl FnMut(&[Column], usize)) {
        struct Each<E>(E);
        impl<E: FnMut(&[Column], usize)> Sink for Each<E> {
            fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
                (self.0)(&table.columns, table.numbers.len());
                Ok(())
            }
        }
        let mut sink = Each(each);
        let mut sheet = Sheet::new(None);
        sheet.tables = Some(Tables::new(self.has_times, false));
        let its = (0..self.len()).filter(|row| self.table(*row) == Some(table));
        for row in its.skip(rows.start).take(rows.len()) {
            self.list(row, &mut sheet);
            // Its columns are those of a frame that was taken before: they fit.
            let _ = sheet.tables.as_mut().map(|tables| tables.give_full(&mut sink));
        }
        let _ = sheet.tables.as_mut().map(|tables| tables.give_rest(&mut sink));
    }

    /// The lines of `axle export` to CSV of these rows of a table; the titles are in front of the
    /// first.
    #[must_use]
    pub fn csv(&self, table: usize, rows: Range<usize>) -> Vec<u8> {
        let mut all = Vec::new();
        if rows.start == 0 {
            all.extend(csv::titles(&self.columns(table)).0);
        }
        self.each_piece(table, rows, |columns, rows| {
            let Ok(()) = csv::each_line(columns, rows, |line| {
                all.extend_from_slice(line);
                Ok::<_, std::convert::Infallible>(())
            });
        });
        all
    }

    fn list(&self, row: usize, sheet: &mut Sheet) {
        match self.kept.get(row) {
            Some((at, Is::Frame(protocol, bytes, mode))) => {
                sheet.modes = Modes::default();
                if let Some(mode) = mode {
                    // Of the node that it commands.
                    NodeId::ALL.into_iter().for_each(|node| sheet.modes.learn(node, mode));
                }
                decode::list_again(protocol, at, bytes, sheet);
            }
            Some((at, Is::Gap(gap))) => sheet.gap(at, &gap),
            None => {}
        }
    }
}
