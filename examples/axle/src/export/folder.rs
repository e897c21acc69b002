//! A folder with a file per table, and one that lists all columns: what CSV and Parquet share.

use std::{
    collections::BTreeMap,
    fmt::Display,
    fs::{self, File},
    hash::{DefaultHasher, Hash, Hasher},
    io::{self, Write},
    mem,
    path::{Path, PathBuf},
    time::{Duration, UNIX_EPOCH},
};

use super::job::Job;
use crate::{
    beside::{Beside, COLUMNS, LIST, cannot_write},
    decode::{self, Walked},
    failure::Failure,
    tables::{Column, Partition, Sink, Table},
};

/// The file of one table.
pub(super) trait TableFile: Sized {
    /// Its extension and that of the folder.
    const EXTENSION: &'static str;

    /// Whether a table of a collection is a folder, with files for each day and line.
    const TAKES_PARTITIONS: bool;

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
    let in_partitions = F::TAKES_PARTITIONS && job.input.is_of_a_collection();
    let mut folder = Folder::<F>::new(path, job.output, in_partitions);
    let go_on = || Job::go_on(&job.signals);
    let walked = decode::walk_into(&mut job.input, &job.chosen, &mut folder, go_on)?;
    let walked = job.chosen.must_have_frames(&job.input, walked)?;
    folder.finish()?;
    beside.keep()?;
    Ok(walked)
}

/// Files that are open at a time: systems allow 256 or more.
const MOST_OPEN: usize = 200;

/// Longest name of a line, bytes: systems allow 255 with all that is added.
const LONGEST_NAME: usize = 200;

pub(super) struct Folder<'a, F> {
    path: PathBuf,
    /// The name that it will have.
    output: &'a Path,
    in_partitions: bool,
    /// By the name of the table: its lines in the list of columns.
    lists: BTreeMap<String, String>,
    /// The files that are open, and how many were begun.
    files: BTreeMap<(String, Option<Partition>), F>,
    begun: usize,
}

impl<F: TableFile> Sink for Folder<'_, F> {
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
        let key = (table.name.clone(), table.partition.clone());
        if !self.files.contains_key(&key) {
            let file = self.begin(table)?;
            self.files.insert(key.clone(), file);
        }
        let Some(file) = self.files.get_mut(&key) else { return Ok(()) };
        file.add(table).map_err(|error| cannot_write(self.output, &error))
    }

    fn takes_partitions(&self) -> bool {
        self.in_partitions
    }
}

impl<'a, F: TableFile> Folder<'a, F> {
    pub(super) fn new(path: PathBuf, output: &'a Path, in_partitions: bool) -> Self {
        let (lists, files) = (BTreeMap::new(), BTreeMap::new());
        Self { path, output, in_partitions, lists, files, begun: 0 }
    }

    fn begin(&mut self, table: &Table) -> Result<F, Failure> {
        if self.files.len() >= MOST_OPEN {
            self.end_files()?;
        }
        self.lists.entry(table.name.clone()).or_insert_with(|| listed(table));
        let mut path = self.path.join(format!("{}.{}", table.name, F::EXTENSION));
        if let Some(partition) = &table.partition {
            path.push(folders_of(partition));
            fs::create_dir_all(&path).map_err(|error| cannot_write(self.output, &error))?;
            path.push(format!("{}.{}", self.begun, F::EXTENSION));
        }
        self.begun += 1;
        F::create(&path, table).map_err(|error| cannot_write(self.output, &error))
    }

    fn end_files(&mut self) -> Result<(), Failure> {
        let files = mem::take(&mut self.files).into_values();
        let mut ended = files.map(F::finish);
        ended.try_for_each(|it| it.map_err(|error| cannot_write(self.output, &error)))
    }

    /// Ends every file, and writes the list of their columns.
    pub(super) fn finish(mut self) -> Result<(), Failure> {
        self.end_files()?;
        let list = self.lists.into_values().fold(format!("{COLUMNS}\n"), |list, its| list + &its);
        let written = write(&self.path.join(LIST), &list);
        written.map_err(|error| cannot_write(self.output, &error))
    }
}

/// The folders of a partition, such as `day=2026-11-27/line=rover-1%2FttyS4`, which Spark, DuckDB
/// and others read as two columns.
fn folders_of(partition: &Partition) -> String {
    let time = UNIX_EPOCH + Duration::from_secs(partition.day * 24 * 60 * 60);
    let day = humantime::format_rfc3339_seconds(time).to_string();
    let day = day.get(..10).unwrap_or(&day);
    let mut line = String::new();
    for char in partition.line.chars() {
        match char {
            // What is left is told apart by a number that is made of it.
            _ if line.len() > LONGEST_NAME => {
                let mut hasher = DefaultHasher::new();
                partition.line.hash(&mut hasher);
                line.push_str(&format!("~{:016x}", hasher.finish()));
                break;
            }
            '-' | '.' | '_' => line.push(char),
            _ if char.is_alphanumeric() => line.push(char),
            _ => {
                for byte in char.encode_utf8(&mut [0; 4]).bytes() {
                    line.push_str(&format!("%{byte:02X}"));
                }
            }
        }
    }
    format!("day={day}/line={line}")
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
