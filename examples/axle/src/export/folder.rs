//! A folder with a file per table, and one that lists all columns: what CSV and Parquet share.

use std::{
    collections::BTreeMap,
    fmt::Display,
    fs::File,
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::job::Job;
use crate::{
    beside::{Beside, COLUMNS, LIST, cannot_write},
    decode::{self, Walked},
    failure::Failure,
    tables::{Column, Sink, Table},
};

/// The file of one table.
pub(super) trait TableFile: Sized {
    /// Its extension and that of the folder.
    const EXTENSION: &'static str;

    type Error: Display;

    /// Begins it: with what is in front of the rows.
    fn create(path: &Path, table: &Table) -> Result<Self, Self::Error>;

    /// Adds the rows that the table holds.
    fn add(&mut self, table: &Table) -> Result<(), Self::Error>;

    fn finish(self) -> Result<(), Self::Error>;
}

pub(super) fn export<F: TableFile>(mut job: Job<'_>) -> Result<Walked, Failure> {
    let (beside, path) = Beside::folder(job.output, job.force, F::EXTENSION, &job.input)?;
    beside.end_on(&job.signals);
    let mut folder = Folder::<F>::new(path, job.output);
    let go_on = || Job::go_on(&job.signals);
    let walked = decode::walk_into(&mut job.input, &job.chosen, &mut folder, go_on)?;
    folder.finish()?;
    beside.keep()?;
    Ok(walked)
}

pub(super) struct Folder<'a, F> {
    path: PathBuf,
    /// The name that it will have.
    output: &'a Path,
    /// By the name of the table: its lines in the list of columns, and its file.
    files: BTreeMap<String, (String, F)>,
}

impl<F: TableFile> Sink for Folder<'_, F> {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
        let cannot = |error| cannot_write(self.output, &error);
        if !self.files.contains_key(&table.name) {
            let path = self.path.join(format!("{}.{}", table.name, F::EXTENSION));
            let file = F::create(&path, table).map_err(cannot)?;
            self.files.insert(table.name.clone(), (listed(table), file));
        }
        let Some((_, file)) = self.files.get_mut(&table.name) else { return Ok(()) };
        file.add(table).map_err(cannot)
    }
}

impl<'a, F: TableFile> Folder<'a, F> {
    pub(super) fn new(path: PathBuf, output: &'a Path) -> Self {
        Self { path, output, files: BTreeMap::new() }
    }

    /// Ends every file, and writes the list of their columns.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let mut list = format!("{COLUMNS}\n");
        for (lines, file) in self.files.into_values() {
            file.finish().map_err(|error| cannot_write(self.output, &error))?;
            list.push_str(&lines);
        }
        let written = write(&self.path.join(LIST), &list);
        written.map_err(|error| cannot_write(self.output, &error))
    }
}

/// The lines of a table in the list of columns.
fn listed(table: &Table) -> String {
    let line = |column: &Column| {
        let (name, unit, kind) = (&column.name, column.unit, column.kind.name());
        format!("{},{name},{unit},{kind}\n", table.name)
    };
    table.columns.iter().map(line).collect()
}

fn write(path: &Path, text: &str) -> io::Result<()> {
    File::create(path)?.write_all(text.as_bytes())
}
