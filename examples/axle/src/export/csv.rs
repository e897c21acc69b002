//! CSV: a folder with a file per table.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

use super::folder::TableFile;
use crate::{
    listing::Out,
    tables::{Cell, Table},
};

pub(super) struct Csv(BufWriter<File>);

impl TableFile for Csv {
    const EXTENSION: &'static str = "csv";

    const TAKES_PARTITIONS: bool = false;

    type Error = io::Error;

    fn create(path: &Path, table: &Table) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        let names: Vec<_> = table.columns.iter().map(|column| &*column.name).collect();
        writeln!(file, "{}", names.join(","))?;
        Ok(Self(file))
    }

    fn add(&mut self, table: &Table) -> io::Result<()> {
        let mut out = Out::default();
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
            self.0.write_all(&out.0)?;
            out.0.clear();
        }
        Ok(())
    }

    fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// As in JSON, without quotes: no value has a comma.
fn print(out: &mut Out, cell: Cell<'_>) {
    match cell {
        Cell::Integer(value) => out.text(itoa::Buffer::new().format(value)),
        Cell::Unsigned(value) => out.number(value),
        Cell::Float(value) if value.is_nan() => out.text("nan"),
        Cell::Float(f32::INFINITY) => out.text("inf"),
        Cell::Float(f32::NEG_INFINITY) => out.text("-inf"),
        // Writing to memory does not fail.
        Cell::Float(value) => drop(serde_json::to_writer(&mut out.0, &value)),
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
