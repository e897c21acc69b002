//! Captures as typed columns: what `axle export` writes, for programs that read it in memory.
//!
//! Made for the wheel of `examples/python`. It changes with the tool, without notice.

use std::{
    fmt,
    io::Read,
    ops::Range,
    path::{Path, PathBuf},
    sync::Mutex,
};

pub use axlewire::{fields::Kind, stream::Counters};

pub use crate::tables::{Column, Values};
use crate::{
    args::Protocol,
    captures,
    decode::{self, Chosen, Sheet, Walked},
    failure::Failure,
    input::{Form, Input},
    kept::Kept,
    rows::Rows,
    tables::{Sink, Table, Tables},
};

/// Why a capture could not be read.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Error {
    /// The file cannot be opened or read; with the number of the system's error, if it has one.
    Io(String, Option<i32>),
    /// There is no capture of these protocols in it.
    Capture(String),
    /// An argument is wrong.
    Argument(String),
    /// The reader has had enough.
    Stopped,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(line, _) | Self::Capture(line) | Self::Argument(line) => f.write_str(line),
            Self::Stopped => f.write_str("reading was stopped"),
        }
    }
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        let line = told(&failure);
        match failure {
            Failure::Open { error, .. } | Failure::Read { error, .. } => {
                Self::Io(line, error.raw_os_error())
            }
            Failure::Usage(_) => Self::Argument(line),
            _ => Self::Capture(line),
        }
    }
}

/// Rows of a table.
#[derive(Debug)]
pub struct Batch {
    /// Protocol and message, such as `ucp.report`; `skipped` for the gaps.
    pub table: String,
    /// The number of each row among all frames and gaps of the capture, from 0: in runs, since
    /// most rows follow each other.
    pub numbers: Vec<Range<u64>>,
    /// Of the same length; those of place and time first.
    pub columns: Vec<Column>,
}

/// What was found in a capture that was read to its end.
#[derive(Debug)]
pub struct Summary {
    /// The account of its bytes.
    pub account: Counters,
    /// Packets with a time before that of the packet in front of them.
    pub times_back: u64,
    /// Why the capture could not be read to its end, if so; what comes before that was read.
    pub cut: Option<String>,
    /// What else is to be told: impossible times, and further captures that could not be read.
    pub notes: Vec<String>,
}

/// A capture.
#[allow(missing_debug_implementations, reason = "it has a reader")]
pub struct Capture {
    input: Input,
    chosen: Chosen,
}

impl Capture {
    /// Opens files, and folders of them, which follow each other in the order of time. `protocol`
    /// names that of raw bytes: `ucp`, `ikeya` or `ikeya-3`; without it, it is found out.
    ///
    /// # Errors
    ///
    /// If a file cannot be opened, or is no capture.
    pub fn open(paths: &[PathBuf], protocol: Option<&str>) -> Result<Self, Error> {
        let protocol = named(protocol)?;
        if paths.is_empty() || paths.iter().any(|path| path == Path::new("-")) {
            return Err(Error::Argument("a capture has the name of a file".to_owned()));
        }
        Self::new(captures::open(paths, Form::default())?, protocol)
    }

    /// A capture that is read from somewhere else.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open).
    pub fn of(reader: Box<dyn Read>, protocol: Option<&str>) -> Result<Self, Error> {
        let protocol = named(protocol)?;
        Self::new(Input::of(reader)?, protocol)
    }

    fn new(mut input: Input, protocol: Option<Protocol>) -> Result<Self, Error> {
        input.be_quiet();
        let chosen = decode::choose(&mut input, protocol)?;
        Ok(Self { input, chosen })
    }

    /// The tables that rows can be of, without rows, in the order of the protocols.
    #[must_use]
    pub fn empty(&self) -> Vec<Batch> {
        let mut tables = Tables::new(self.chosen.has_times, false).into_tables();
        tables.iter_mut().map(take).collect()
    }

    /// Reads it: `rows` takes each batch, and `go_on` is asked at least once for every 16 KB.
    ///
    /// # Errors
    ///
    /// If nothing in it is a frame, if it cannot be read, or with those of `rows` and `go_on`.
    pub fn read(
        mut self,
        mut rows: impl FnMut(Batch) -> Result<(), Error>,
        mut go_on: impl FnMut() -> Result<(), Error>,
    ) -> Result<Summary, Error> {
        // Failures of this tool are lines; theirs are kept beside.
        let theirs = Mutex::new(None);
        let keep = |error| {
            theirs.lock().map(|mut kept| *kept = Some(error)).unwrap_or_default();
            Failure::Failed(String::new())
        };
        let mut sink = Taker(|batch| rows(batch).map_err(keep));
        let walked =
            decode::walk_into(&mut self.input, &self.chosen, &mut sink, || go_on().map_err(keep));
        if let Ok(Some(error)) = theirs.into_inner() {
            return Err(error);
        }
        Ok(Summary::of(walked?))
    }
}

impl Capture {
    /// Reads it as rows that stay in memory. `go_on` is asked at least once for every 16 KB.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read), and if there is not enough memory.
    pub fn keep(
        mut self,
        mut go_on: impl FnMut() -> Result<(), Error>,
    ) -> Result<(Rows, Summary), Error> {
        let (mut sheet, mut theirs) = (Sheet::new(None), None);
        sheet.kept = Some(Kept::default());
        let walked = self.chosen.walk(&mut self.input, &mut sheet, |_, sheet| {
            let full = sheet.kept.as_ref().filter(|kept| kept.is_full);
            full.map_or_else(&mut go_on, |kept| Err(no_memory(kept.len()))).map_err(|error| {
                theirs = Some(error);
                Failure::Failed(String::new())
            })
        });
        if let Some(error) = theirs {
            return Err(error);
        }
        let kept = sheet.kept.unwrap_or_default();
        let (is_full, len) = (kept.is_full, kept.len());
        let (rows, summary) = (Rows::new(kept, self.chosen.has_times), Summary::of(walked?));
        if is_full { Err(no_memory(len)) } else { Ok((rows, summary)) }
    }
}

fn no_memory(rows: usize) -> Error {
    Error::Capture(format!("there is no memory for more than {rows} frames and gaps"))
}

impl Summary {
    fn of(mut walked: Walked) -> Self {
        let (account, times_back) = (walked.account, walked.times_back);
        let notes = walked.notes.take().unwrap_or_default();
        let cut = walked.missing().err().map(|failure| told(&failure));
        Self { account, times_back, cut, notes }
    }
}

/// The line of a failure. For the tool, what has no name is its standard input.
fn told(failure: &Failure) -> String {
    let line = failure.to_string();
    line.replace("\"standard input\"", "the capture").replace("standard input", "the capture")
}

fn named(protocol: Option<&str>) -> Result<Option<Protocol>, Error> {
    let Some(name) = protocol else { return Ok(None) };
    Protocol::named(name).map(Some).ok_or_else(|| {
        Error::Argument(format!("protocol {name:?} is none of 'ucp', 'ikeya', 'ikeya-3'"))
    })
}

struct Taker<R>(R);

impl<R: FnMut(Batch) -> Result<(), Failure>> Sink for Taker<R> {
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
        (self.0)(take(table))
    }
}

fn take(table: &mut Table) -> Batch {
    // The next batch is often as long.
    Batch {
        table: table.name.clone(),
        numbers: runs(&table.numbers),
        columns: table.columns.iter_mut().map(Column::take).collect(),
    }
}

fn runs(numbers: &[u64]) -> Vec<Range<u64>> {
    let runs = numbers.chunk_by(|one, next| one + 1 == *next);
    let run = |run: &[u64]| Some(*run.first()?..*run.last()? + 1);
    runs.filter_map(run).collect()
}
