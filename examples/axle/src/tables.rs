//! Frames and gaps of a capture as rows of typed columns: a table per message, and one of gaps.
//!
//! Tables and columns are known before the first byte is read: they are the fields of the library.
//! So a batch of rows is all that is held, and a [`Sink`] takes it in: a file format.

mod column;
pub(crate) mod csv;
mod described;
mod hot;
mod row;

use std::{collections::BTreeMap, mem, ptr, rc::Rc};

use axlewire::fields::Shape;

use crate::{
    args::Protocol,
    failure::Failure,
    listing::{Modes, Place, REASONS, Shown, SkippedBytes},
};
use column::Unfit;
pub use column::{Column, Values};
use described::Described;
#[cfg(feature = "mcap")]
pub(crate) use described::json_schema;
pub(crate) use described::name;
use hot::Waiting;
use row::{Row, Slot};

/// Rows of a table after which they go to the sink.
const BATCH: usize = 64 * 1024;

/// Partitions after which all rows go to the sink.
const MOST_PARTITIONS: usize = 256;

const DAY_US: u64 = 24 * 60 * 60 * 1_000_000;

/// Takes in the rows of all tables.
pub(crate) trait Sink {
    /// Takes in the next rows of a table. They are in the order of `axle decode --json`, which is
    /// [`Table::numbers`]; rows of other tables may come earlier or later. It may take them away.
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure>;

    /// Whether each day and line has tables of its own. The rows of a table are then in order
    /// within their partition.
    fn takes_partitions(&self) -> bool {
        false
    }
}

/// Which rows a table has, if not all.
#[derive(Clone, Debug, Default, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) struct Partition {
    /// Day since 1970, UTC. A row without a time is in that of the row before it on its line.
    pub(crate) day: u64,
    /// Name of the line.
    pub(crate) line: Rc<str>,
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
    /// `None` if it has all rows of the message.
    pub(crate) partition: Option<Partition>,
    pub(crate) columns: Vec<Column>,
    /// The number of each row among the frames and gaps of the capture, from 0.
    pub(crate) numbers: Vec<u64>,
    /// Where each field of a frame goes, behind the columns of its place.
    slots: Vec<Slot>,
    /// Number of the columns of its place.
    place: usize,
    /// Rows whose columns are to be filled.
    waiting: Waiting,
}

/// All tables.
#[derive(Debug)]
pub(crate) struct Tables {
    /// By protocol; then the gaps. Those of the last row, if there are partitions.
    all: Vec<Table>,
    /// The partition of the last row, if there are such, and the tables of the others.
    partition: Option<Partition>,
    others: BTreeMap<Partition, Vec<Table>>,
    /// The line of the next row, and the latest day of each.
    line: Rc<str>,
    days: BTreeMap<Rc<str>, u64>,
    /// The first of each protocol.
    first: [usize; 3],
    /// The table of the last frame, and its message: the next is often of the same.
    last: usize,
    last_message: (Protocol, &'static str),
    has_times: bool,
    /// Frames and gaps so far.
    count: u64,
    /// Rows since the last ones went to the sink.
    held: usize,
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
    pub(crate) fn new(has_times: bool, in_partitions: bool) -> Self {
        let partition = in_partitions.then(Partition::default);
        let all = empty(has_times, partition.as_ref());
        let first = [0, 1, 2].map(|protocol| all.partition_point(|it| place(it) < protocol));
        Self {
            all,
            partition,
            others: BTreeMap::new(),
            line: Rc::default(),
            days: BTreeMap::new(),
            first,
            last: usize::MAX,
            last_message: (Protocol::Ucp, ""),
            has_times,
            count: 0,
            held: 0,
            is_full: false,
            unfit: None,
        }
    }

    /// All tables, of the last partition.
    pub(crate) fn into_tables(self) -> Vec<Table> {
        self.all
    }

    /// What follows is of the line with this name.
    pub(crate) fn turn_to(&mut self, line: &Rc<str>) {
        if self.partition.is_some() && self.line != *line {
            self.line = Rc::clone(line);
        }
    }

    /// Lays out the tables of the partition in which a row with this time is.
    fn turn_to_day(&mut self, micros: Option<u64>) {
        let Some(last) = &mut self.partition else { return };
        let day = match micros {
            Some(micros) => micros / DAY_US,
            None => self.days.get(&self.line).copied().unwrap_or_default(),
        };
        if last.day == day && last.line == self.line {
            return;
        }
        let next = Partition { day, line: Rc::clone(&self.line) };
        self.days.insert(Rc::clone(&self.line), day);
        let known = self.others.remove(&next);
        let tables = known.unwrap_or_else(|| empty(self.has_times, Some(&next)));
        self.others.insert(mem::replace(last, next), mem::replace(&mut self.all, tables));
        self.is_full |= self.others.len() >= MOST_PARTITIONS;
    }

    /// Adds a frame. `modes` are those of the nodes in front of it.
    pub(crate) fn frame<S: Shown>(&mut self, at: Place, frame: &S, modes: &Modes) {
        self.turn_to_day(at.micros);
        let (name, (last_protocol, last_name)) = (frame.name(), self.last_message);
        // By its place in memory: texts in different places are searched for.
        if last_protocol != S::PROTOCOL || !ptr::eq(last_name, name) {
            let is_its = |it: &Table| (it.protocol, it.message) == (Some(S::PROTOCOL), name);
            let first = self.first.get(S::PROTOCOL as usize).copied().unwrap_or_default();
            let its = self.all.iter().skip(first).position(is_its);
            self.last = its.map_or(usize::MAX, |at| first + at);
            self.last_message = (S::PROTOCOL, name);
        }
        let mode = frame.commands().and_then(|node| modes.of(node));
        let added = self.add(self.last, at, |table| {
            if let Some(hot) = frame.hot() {
                table.columns.last_mut().ok_or(Unfit)?.bytes(frame.bytes())?;
                return if table.waiting.add(hot) { table.fill() } else { Ok(()) };
            }
            table.fill()?;
            let (slots, columns) = (&*table.slots, &mut *table.columns);
            let columns = columns.get_mut(table.place..).unwrap_or_default();
            frame.serialize(Row { slots, columns, whole: frame.bytes(), mode })
        });
        if let Err(unfit) = added {
            self.unfit = Some(unfit);
        }
    }

    /// Adds a gap.
    pub(crate) fn gap(&mut self, at: Place, gap: &SkippedBytes) {
        self.turn_to_day(at.micros);
        let Some(last) = self.all.iter().position(|table| table.protocol.is_none()) else { return };
        let added = self.add(last, at, |table| {
            let mut columns = table.columns.iter_mut().skip(table.place);
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

    /// Adds a row to a table; `rest` fills the columns behind those of its place. If the row does
    /// not fit, the table is as before.
    #[inline]
    fn add(
        &mut self,
        table: usize,
        at: Place,
        rest: impl FnOnce(&mut Table) -> Result<(), Unfit>,
    ) -> Result<(), Unfit> {
        let number = self.count;
        let table = self.all.get_mut(table).ok_or(Unfit)?;
        let rows = table.numbers.len();
        let added = table.place(at).and_then(|()| rest(table));
        if added.is_err() {
            table.columns.iter_mut().for_each(|column| column.take_back(rows));
            return added;
        }
        table.numbers.push(number);
        self.count += 1;
        self.held += 1;
        self.is_full |= rows + 1 >= BATCH || (self.partition.is_some() && self.held >= BATCH);
        Ok(())
    }

    /// Hands every table that has a batch to `sink`.
    pub(crate) fn give_full(&mut self, sink: &mut dyn Sink) -> Result<(), Failure> {
        if self.is_full {
            self.is_full = false;
            // A partition that is over gets no full batch.
            self.give(if self.partition.is_some() { 1 } else { BATCH }, sink)?;
            self.others.clear();
        }
        self.unfit.map_or(Ok(()), |_| Err(bug()))
    }

    /// Hands all rows to `sink`.
    pub(crate) fn give_rest(&mut self, sink: &mut dyn Sink) -> Result<(), Failure> {
        self.give(1, sink)?;
        self.unfit.map_or(Ok(()), |_| Err(bug()))
    }

    fn give(&mut self, least: usize, sink: &mut dyn Sink) -> Result<(), Failure> {
        self.held = 0;
        for table in self.others.values_mut().flatten().chain(&mut self.all) {
            if table.numbers.len() >= least {
                table.fill().map_err(|_| bug())?;
                sink.rows(table)?;
                table.numbers.clear();
                table.columns.iter_mut().for_each(Column::clear);
            }
        }
        Ok(())
    }
}

/// Empty tables, by protocol.
fn empty(has_times: bool, partition: Option<&Partition>) -> Vec<Table> {
    let described = described::all().into_iter();
    let mut all: Vec<_> = described.map(|it| Table::new(it, has_times, partition)).collect();
    all.sort_by_key(place);
    all
}

/// Where its protocol is among all; gaps are last.
fn place(table: &Table) -> usize {
    table.protocol.map_or(3, |protocol| protocol as usize)
}

impl Table {
    fn new(of: Described, has_times: bool, partition: Option<&Partition>) -> Self {
        let (mut columns, mut slots, mut place) = (Vec::new(), Vec::new(), 0);
        for (field, names) in of.fields {
            let name = field.name;
            let is_place = PLACE.contains(&name);
            let first = columns.len() - place;
            if IN_THE_NAME.contains(&name) {
                // No line of a table would differ from another.
            } else if !is_place || has_times || name == "offset" {
                let titles = match field.shape {
                    Shape::One => vec![name.to_owned()],
                    Shape::Array(len) => (0..len).map(|at| format!("{name}_{at}")).collect(),
                    Shape::Object(keys) => keys.iter().map(|key| format!("{name}_{key}")).collect(),
                };
                columns.extend(titles.into_iter().map(|it| Column::new(it, &field, names.clone())));
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
        let partition = partition.cloned();
        let waiting = Waiting::default();
        Self { name, protocol, message, partition, columns, numbers, slots, place, waiting }
    }

    /// Fills the columns of rows that wait.
    fn fill(&mut self) -> Result<(), Unfit> {
        self.waiting.fill(self.columns.get_mut(self.place..).unwrap_or_default())
    }

    /// Fills the columns of a place.
    #[inline]
    fn place(&mut self, at: Place) -> Result<(), Unfit> {
        let place = self.columns.get_mut(..self.place).ok_or(Unfit)?;
        let (offset, rest) = place.split_first_mut().ok_or(Unfit)?;
        offset.unsigned(at.offset)?;
        let [t, interface, direction] = rest else { return Ok(()) };
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
        Ok(())
    }
}

/// What the tests exclude.
fn bug() -> Failure {
    let line = "the tool has a bug: a frame has a field that the table of fields has not";
    Failure::Failed(line.to_owned())
}

#[cfg(test)]
pub(crate) mod tests;
