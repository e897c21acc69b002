//! CSV: a folder with a file per table, and one that lists all columns.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use super::{Job, cannot_write};
use crate::{
    beside::{Beside, COLUMNS, LIST},
    decode::{self, Walked},
    failure::Failure,
    listing::Out,
    tables::{Cell, Sink, Table},
};

pub(super) fn export(mut job: Job<'_>) -> Result<Walked, Failure> {
    let (beside, path) = Beside::folder(job.output, job.force, "csv", &job.input)?;
    beside.end_on(&job.signals);
    let mut folder = Folder { path, output: job.output, files: BTreeMap::new() };
    let mut list = List::default();
    let mut sink = Both(&mut folder, &mut list);
    let go_on = || Job::go_on(&job.signals);
    let walked = decode::walk_into(&mut job.input, &job.chosen, &mut sink, go_on)?;
    let cannot = |error| cannot_write(job.output, &error);
    for mut file in folder.files.into_values() {
        file.flush().map_err(cannot)?;
    }
    list.write(&folder.path).map_err(cannot)?;
    beside.keep()?;
    Ok(walked)
}

/// Rows for two sinks.
pub(super) struct Both<'a>(pub(super) &'a mut dyn Sink, pub(super) &'a mut List);

impl Sink for Both<'_> {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
        self.1.rows(table)?;
        self.0.rows(table)
    }
}

/// The columns of all tables with rows: `columns.csv`, which both kinds of folders have.
#[derive(Default)]
pub(super) struct List(BTreeMap<String, String>);

impl List {
    pub(super) fn write(&self, folder: &Path) -> io::Result<()> {
        let mut file = File::create(folder.join(LIST))?;
        file.write_all(format!("{COLUMNS}\n").as_bytes())?;
        self.0.values().try_for_each(|lines| file.write_all(lines.as_bytes()))
    }
}

impl Sink for List {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
        if !self.0.contains_key(&table.name) {
            let line = |column: &crate::tables::Column| {
                let (name, unit, kind) = (&column.name, column.unit, column.kind.name());
                format!("{},{name},{unit},{kind}\n", table.name)
            };
            self.0.insert(table.name.clone(), table.columns.iter().map(line).collect());
        }
        Ok(())
    }
}

/// A file per table.
struct Folder<'a> {
    path: PathBuf,
    /// The name that it will have.
    output: &'a Path,
    files: BTreeMap<String, BufWriter<File>>,
}

impl Sink for Folder<'_> {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
        let cannot = |error| cannot_write(self.output, &error);
        let mut out = Out::default();
        if !self.files.contains_key(&table.name) {
            let file = File::create(self.path.join(format!("{}.csv", table.name)));
            let file = BufWriter::new(file.map_err(cannot)?);
            self.files.insert(table.name.clone(), file);
            let names: Vec<_> = table.columns.iter().map(|column| &*column.name).collect();
            out.text(&names.join(","));
            out.text("\n");
        }
        let Some(file) = self.files.get_mut(&table.name) else { return Ok(()) };
        let mut columns: Vec<_> = table.columns.iter().map(|column| column.cells()).collect();
        for _ in &table.numbers {
            let mut before = "";
            for column in &mut columns {
                out.text(before);
                before = ",";
                if let Some(cell) = column.next().flatten() {
                    print(&mut out, cell);
                }
            }
            out.text("\n");
            file.write_all(&out.0).map_err(cannot)?;
            out.0.clear();
        }
        Ok(())
    }
}

/// As in JSON, without quotes: only a text may have a comma, and then it has those of CSV.
fn print(out: &mut Out, cell: Cell<'_>) {
    match cell {
        Cell::Integer(value) => out.text(itoa::Buffer::new().format(value)),
        Cell::Unsigned(value) => out.number(value),
        Cell::Float(value) if value.is_nan() => out.text("nan"),
        Cell::Float(f32::INFINITY) => out.text("inf"),
        Cell::Float(f32::NEG_INFINITY) => out.text("-inf"),
        // Writing to memory does not fail.
        Cell::Float(value) => drop(serde_json::to_writer(&mut out.0, &value)),
        Cell::Double(value) if value.is_nan() => out.text("nan"),
        Cell::Double(f64::INFINITY) => out.text("inf"),
        Cell::Double(f64::NEG_INFINITY) => out.text("-inf"),
        Cell::Double(value) => drop(serde_json::to_writer(&mut out.0, &value)),
        Cell::Flag(value) => out.text(if value { "true" } else { "false" }),
        Cell::Text(text) if text.is_empty() || text.contains([',', '"', '\n', '\r']) => {
            out.text("\"");
            out.text(&text.replace('"', "\"\""));
            out.text("\"");
        }
        Cell::Text(text) => out.text(text),
        Cell::Time(micros) => crate::listing::seconds(out, micros),
        Cell::Name(name) => out.text(name),
        Cell::Bytes(bytes) => {
            let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 0x0F]);
            out.0.extend(
                digits.map(|digit| b"0123456789abcdef".get(usize::from(digit)).unwrap_or(&0)),
            );
        }
    }
}
