//! CSV: a folder with a file per table.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

use super::folder::TableFile;
use crate::tables::{Table, csv};

pub(super) struct Csv(BufWriter<File>);

impl TableFile for Csv {
    const EXTENSION: &'static str = "csv";

    const TAKES_PARTITIONS: bool = false;

    type Error = io::Error;

    fn create(path: &Path, table: &Table) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        file.write_all(&csv::titles(&table.columns).0)?;
        Ok(Self(file))
    }

    fn add(&mut self, table: &Table) -> io::Result<()> {
        csv::each_line(&table.columns, table.numbers.len(), |line| self.0.write_all(line))
    }

    fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}
