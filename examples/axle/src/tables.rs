//! Frames and gaps of a capture as rows of typed columns: a table per message, and one of gaps.
//!
//! Tables and columns are known before the first byte is read, from the schema of `decode --json`.
//! So a batch of rows is all that is held, and a [`Sink`] takes it in: a file format, or a plot.
//! A message that the schema has not, or a layout of one, gets a table of its own when it comes.

mod column;
mod described;
mod own;
mod row;

use crate::{
    args::Protocol,
    failure::Failure,
    listing::{LineClock, Modes, Out, Place, REASONS, Shown, SkippedBytes, Style},
};
#[cfg(feature = "parquet")]
pub(crate) use column::Values;
pub(crate) use column::{Cell, Column};
pub(crate) use described::Type;
#[cfg(feature = "mcap")]
pub(crate) use described::json_schema;
use described::{Described, Field, Kind};
use own::Line;
use row::{Row, Slot, Unfit};

/// Rows of a table after which they go to the sink.
const BATCH: usize = 64 * 1024;

/// Takes in the rows of all tables.
pub(crate) trait Sink {
    /// Takes in the next rows of a table. They are in the order of `axle decode --json`, which is
    /// [`Table::numbers`]; rows of other tables may come earlier or later.
    fn rows(&mut self, table: &Table) -> Result<(), Failure>;
}

/// Rows of one message.
#[derive(Debug)]
pub(crate) struct Table {
    /// Protocol and message, such as `ucp.report`; `skipped` for the gaps.
    pub(crate) name: String,
    /// `None` for the gaps.
    pub(crate) protocol: Option<Protocol>,
    /// Name of the message; `skipped` for the gaps.
    pub(crate) message: &'static str,
    pub(crate) columns: Vec<Column>,
    /// The number of each row among the frames and gaps of the capture, from 0.
    pub(crate) numbers: Vec<u64>,
    /// Where each field of a frame goes, behind the columns of its place.
    slots: Vec<Slot>,
    /// Of a table that the schema does not have: its fields, and their first columns behind those
    /// of the place.
    own: Vec<(Field, usize)>,
}

/// All tables.
#[derive(Debug)]
pub(crate) struct Tables {
    /// By protocol; then the gaps, and last those that the schema does not have.
    all: Vec<Table>,
    /// The first of each protocol.
    first: [usize; 3],
    /// The table of the last frame: the next is often of the same message.
    last: usize,
    has_times: bool,
    /// Frames and gaps so far.
    count: u64,
    /// Whether some table has a batch.
    is_full: bool,
    unfit: Option<Unfit>,
}

/// Fields that are the same in all rows of a table: its name says them.
const IN_THE_NAME: [&str; 3] = ["event", "protocol", "message"];

/// Fields of a [`Place`], in front of those of the frame.
const PLACE: [&str; 4] = ["offset", "t", "interface", "direction"];

impl Tables {
    /// Empty tables. Without times there are no columns of time, interface and direction.
    pub(crate) fn new(has_times: bool) -> Result<Self, Failure> {
        let Some(described) = described::all() else { return Err(bug()) };
        let mut all: Vec<_> = described.into_iter().map(|it| Table::new(it, has_times)).collect();
        let place = |table: &Table| table.protocol.map_or(3, |protocol| protocol as usize);
        all.sort_by_key(place);
        let first = [0, 1, 2].map(|protocol| all.partition_point(|it| place(it) < protocol));
        Ok(Self { all, first, last: 0, has_times, count: 0, is_full: false, unfit: None })
    }

    /// Adds a frame. `modes` are those of the nodes in front of it.
    pub(crate) fn frame<S: Shown>(&mut self, at: Place, frame: &S, modes: &Modes) {
        let name = frame.name();
        let is_its = |table: &Table| table.is_of(S::PROTOCOL, name) && table.own.is_empty();
        if !self.all.get(self.last).is_some_and(is_its) {
            let first = self.first.get(S::PROTOCOL as usize).copied().unwrap_or_default();
            let its = self.all.iter().skip(first).position(is_its);
            self.last = its.map_or(usize::MAX, |at| first + at);
        }
        let mode = frame.commands().and_then(|node| modes.of(node));
        let added = self.add(self.last, at, |table, from| {
            let (slots, columns) = (&*table.slots, &mut *table.columns);
            let columns = columns.get_mut(from..).unwrap_or_default();
            frame.serialize(Row { slots, columns, whole: frame.bytes(), mode })
        });
        if added.is_err()
            && let Err(unfit) = self.line(at, frame, modes)
        {
            self.unfit = Some(unfit);
        }
    }

    /// Adds a frame that is not as the schema says, as its line: to a table of such lines, which is
    /// made if there is none.
    #[cold]
    fn line<S: Shown>(&mut self, at: Place, frame: &S, modes: &Modes) -> Result<(), Unfit> {
        let mut out = Out::default();
        Style::Json.frame(&mut out, &mut LineClock::default(), at, frame, modes);
        let line = Line::read(&out.0).ok_or(Unfit)?;
        let name = frame.name();
        let mut layouts = 0;
        for table in 0..self.all.len() {
            let Some(known) = self.all.get(table) else { break };
            if known.is_of(S::PROTOCOL, name) {
                layouts += 1;
                let is_own = !known.own.is_empty();
                if is_own && self.add(table, at, |table, from| table.line(from, &line)).is_ok() {
                    return Ok(());
                }
            }
        }
        let all = described::all().ok_or(Unfit)?;
        let new = own::describe(&all, Some(S::PROTOCOL), name, &line).ok_or(Unfit)?;
        let mut table = Table::of_lines(new, self.has_times);
        if layouts > 0 {
            table.name = format!("{}-{}", table.name, layouts + 1);
        }
        self.all.push(table);
        self.add(self.all.len() - 1, at, |table, from| table.line(from, &line))
    }

    /// Adds a gap.
    pub(crate) fn gap(&mut self, at: Place, gap: &SkippedBytes) {
        let Some(last) = self.all.iter().position(|table| table.protocol.is_none()) else { return };
        let added = self.add(last, at, |table, from| {
            let mut columns = table.columns.iter_mut().skip(from);
            let mut next = || columns.next().ok_or(Unfit);
            next()?.unsigned(gap.length)?;
            next()?.text(gap.reason.name())?;
            // If it is the only one, that says all.
            let has_several = gap.account.skipped_for(gap.reason) < gap.length;
            for reason in REASONS {
                match gap.account.skipped_for(reason) {
                    bytes if has_several && bytes > 0 => next()?.unsigned(bytes)?,
                    _ => next()?.absent()?,
                }
            }
            Ok(())
        });
        if let Err(unfit) = added {
            self.unfit = Some(unfit);
        }
    }

    /// Adds a row to a table; `rest` fills the columns from its second argument on. If the row does
    /// not fit, the table is as before.
    #[inline]
    fn add(
        &mut self,
        table: usize,
        at: Place,
        rest: impl FnOnce(&mut Table, usize) -> Result<(), Unfit>,
    ) -> Result<(), Unfit> {
        let number = self.count;
        let table = self.all.get_mut(table).ok_or(Unfit)?;
        let rows = table.numbers.len();
        let added = table.place(at, self.has_times).and_then(|from| rest(table, from));
        if added.is_err() {
            table.columns.iter_mut().for_each(|column| column.take_back(rows));
            return added;
        }
        table.numbers.push(number);
        self.count += 1;
        self.is_full |= rows + 1 >= BATCH;
        Ok(())
    }

    /// Hands every table that has a batch to `sink`.
    pub(crate) fn give_full(&mut self, sink: &mut dyn Sink) -> Result<(), Failure> {
        if self.is_full {
            self.is_full = false;
            self.give(BATCH, sink)?;
        }
        self.unfit.map_or(Ok(()), |_| Err(bug()))
    }

    /// Hands all rows to `sink`.
    pub(crate) fn give_rest(&mut self, sink: &mut dyn Sink) -> Result<(), Failure> {
        self.give(1, sink)?;
        self.unfit.map_or(Ok(()), |_| Err(bug()))
    }

    fn give(&mut self, least: usize, sink: &mut dyn Sink) -> Result<(), Failure> {
        for table in &mut self.all {
            if table.numbers.len() >= least {
                sink.rows(table)?;
                table.numbers.clear();
                table.columns.iter_mut().for_each(Column::clear);
            }
        }
        Ok(())
    }
}

impl Table {
    fn is_of(&self, protocol: Protocol, message: &str) -> bool {
        self.protocol == Some(protocol) && self.message == message
    }

    /// A table whose rows are added as lines.
    fn of_lines(of: Described, has_times: bool) -> Self {
        let fields = of.fields.clone();
        let mut table = Self::new(of, has_times);
        for slot in core::mem::take(&mut table.slots) {
            let field = fields.iter().find(|field| field.name == slot.name && slot.width > 0);
            table.own.extend(field.map(|field| (field.clone(), slot.first)));
        }
        table
    }

    fn new(of: Described, has_times: bool) -> Self {
        let (mut columns, mut slots, mut place) = (Vec::new(), Vec::new(), 0);
        for field in of.fields {
            let (name, unit, is_optional) = (field.name, field.unit, field.is_optional);
            let is_place = PLACE.contains(&&*name);
            let first = columns.len() - place;
            if IN_THE_NAME.contains(&&*name) {
                // No line of a table would differ from another.
            } else if !is_place || has_times || name == "offset" {
                let mut column = |name: String, kind, is_optional| {
                    columns.push(Column::new(name, kind, unit, is_optional));
                };
                match field.kind {
                    Kind::One(kind) => column(name.to_string(), kind, is_optional),
                    Kind::Array(kind, len) => {
                        for at in 0..len {
                            column(format!("{name}_{at}"), kind.clone(), is_optional);
                        }
                    }
                    Kind::Object(kind, names) => {
                        for of in names {
                            column(format!("{name}_{of}"), kind.clone(), true);
                        }
                    }
                }
            }
            if is_place {
                place = columns.len();
            } else if name != "event" {
                let (width, is_whole) = (columns.len() - place - first, name == "bytes");
                slots.push(Slot { name, first, width, is_whole });
            }
        }
        let name = name(of.protocol, of.message);
        let (protocol, message, numbers) = (of.protocol, of.message, Vec::new());
        Self { name, protocol, message, columns, numbers, slots, own: Vec::new() }
    }

    /// Fills the columns of a place, and returns their number.
    #[inline]
    fn place(&mut self, at: Place, has_times: bool) -> Result<usize, Unfit> {
        let (offset, rest) = self.columns.split_first_mut().ok_or(Unfit)?;
        offset.unsigned(at.offset)?;
        if !has_times {
            return Ok(1);
        }
        let [t, interface, direction, ..] = rest else { return Err(Unfit) };
        match at.micros {
            Some(micros) => t.unsigned(micros)?,
            None => t.absent()?,
        }
        match at.interface {
            Some(number) => interface.unsigned(number as u64)?,
            None => interface.absent()?,
        }
        match at.direction {
            Some(way) => direction.text(way.name())?,
            None => direction.absent()?,
        }
        Ok(PLACE.len())
    }
}

/// The name of a table: protocol and message, or `skipped`.
pub(crate) fn name(protocol: Option<Protocol>, message: &str) -> String {
    match protocol {
        Some(protocol) => format!("{}.{message}", protocol.name()),
        None => message.to_owned(),
    }
}

/// What the tests exclude.
fn bug() -> Failure {
    let line = "the tool has a bug: a frame has a field that decode.schema.json has not";
    Failure::Failed(line.to_owned())
}

#[cfg(test)]
pub(crate) mod tests;
