//! Parquet: a folder with a file per table.

use std::{fs::File, ops::Range, path::Path, sync::Arc};

use axlewire::fields::Kind;
use bytes::Bytes;
use parquet::{
    basic::{Encoding, LogicalType, Repetition, TimeUnit, Type as Physical},
    column::{
        page::{CompressedPage, Page, PageWriter},
        writer::ColumnCloseResult,
    },
    data_type::{ByteArray, ByteArrayType, DataType, FloatType, Int32Type, Int64Type},
    errors::ParquetError,
    file::{
        metadata::{ColumnChunkMetaData, KeyValue},
        properties::{EnabledStatistics, WriterProperties, WriterVersion},
        writer::{
            SerializedColumnWriter, SerializedFileWriter, SerializedPageWriter, TrackedWrite,
        },
    },
    schema::types::{ColumnDescPtr, ColumnPath, Type as Field},
};

use super::folder::TableFile;
use crate::tables::{Column, Table, Values};

pub(super) struct Parquet(SerializedFileWriter<File>);

impl TableFile for Parquet {
    const EXTENSION: &'static str = "parquet";

    const TAKES_PARTITIONS: bool = true;

    type Error = ParquetError;

    fn create(path: &Path, table: &Table) -> Result<Self, ParquetError> {
        create(path, table).map(Self)
    }

    fn add(&mut self, table: &Table) -> Result<(), ParquetError> {
        group(&mut self.0, table)
    }

    fn finish(mut self) -> Result<(), ParquetError> {
        self.0.finish().map(drop)
    }
}

fn create(path: &Path, table: &Table) -> Result<SerializedFileWriter<File>, ParquetError> {
    let fields = table.columns.iter().map(|column| field(column).map(Arc::new));
    let fields = fields.collect::<Result<_, _>>()?;
    let schema = Field::group_type_builder(&table.name).with_fields(fields).build()?;
    let units = table.columns.iter().filter(|column| column.unit != "none");
    let units =
        units.map(|column| KeyValue::new(format!("unit:{}", column.name), column.unit.to_owned()));
    // Plain values: looking each up in a dictionary takes longer than writing it, and most are
    // measurements, of which there are many. Statistics are for what is searched.
    let mut properties = WriterProperties::builder()
        .set_writer_version(WriterVersion::PARQUET_1_0)
        .set_created_by("axle".to_owned())
        .set_encoding(Encoding::PLAIN)
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_offset_index_disabled(true)
        .set_write_batch_size(8 * 1024)
        .set_key_value_metadata(Some(units.collect()));
    for column in &table.columns {
        let path = ColumnPath::from(&*column.name);
        if matches!(column.kind, Kind::Name(_)) {
            properties = properties.set_column_dictionary_enabled(path, true);
        } else if ["t", "offset"].contains(&&*column.name) {
            properties = properties.set_column_statistics_enabled(path, EnabledStatistics::Chunk);
        }
    }
    let file = File::create(path)?;
    SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build()))
}

fn field(column: &Column) -> Result<Field, ParquetError> {
    let (physical, logical) = match column.kind {
        Kind::U8 => (Physical::INT32, Some(LogicalType::integer(8, false))),
        Kind::I8 => (Physical::INT32, Some(LogicalType::integer(8, true))),
        Kind::I16 => (Physical::INT32, Some(LogicalType::integer(16, true))),
        Kind::U16 => (Physical::INT32, Some(LogicalType::integer(16, false))),
        Kind::I32 => (Physical::INT32, Some(LogicalType::integer(32, true))),
        Kind::U32 => (Physical::INT32, Some(LogicalType::integer(32, false))),
        Kind::U64 => (Physical::INT64, Some(LogicalType::integer(64, false))),
        Kind::F32 => (Physical::FLOAT, None),
        Kind::Time => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::MICROS))),
        Kind::Name(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Kind::Bytes => (Physical::BYTE_ARRAY, None),
    };
    let repetition = match column.present {
        Some(_) => Repetition::OPTIONAL,
        None => Repetition::REQUIRED,
    };
    Field::primitive_type_builder(&column.name, physical)
        .with_repetition(repetition)
        .with_logical_type(logical)
        .build()
}

/// Writes the rows as one row group.
fn group(file: &mut SerializedFileWriter<File>, table: &Table) -> Result<(), ParquetError> {
    let descriptions = file.schema_descr().columns().to_vec();
    let mut group = file.next_row_group()?;
    for (column, description) in table.columns.iter().zip(descriptions) {
        if let (Values::Bytes(ends, all), None) = (&column.values, &column.present) {
            let (pages, close) = bytes(description, ends, all)?;
            group.append_column(&pages, close)?;
            continue;
        }
        let Some(mut to) = group.next_column()? else { break };
        let names: Vec<_> = column.names.iter().map(|name| ByteArray::from(*name)).collect();
        for piece in pieces(column) {
            write(&mut to, column, &names, &piece)?;
        }
        to.close()?;
    }
    group.close()?;
    Ok(())
}

/// Rows that are converted at once: their values stay in a processor's own cache.
const PIECE: usize = 2048;

/// Values of a page of bytes.
const PAGE: usize = 16 * 1024;

/// Some rows of a column.
struct Piece {
    values: Range<usize>,
    /// For each row, 1 if it has a value; `None` if all have.
    levels: Option<Vec<i16>>,
}

fn pieces(column: &Column) -> impl Iterator<Item = Piece> {
    let rows = column.present.as_ref().map_or(column.values.len(), Vec::len);
    let mut next = 0;
    (0..rows).step_by(PIECE).map(move |row| {
        let rows = row..(row + PIECE).min(rows);
        let present = column.present.as_ref().and_then(|present| present.get(rows.clone()));
        let levels = present.map(|it| it.iter().copied().map(i16::from).collect::<Vec<_>>());
        let count = match &levels {
            Some(levels) => levels.iter().filter(|level| **level == 1).count(),
            None => rows.len(),
        };
        let values = next..next + count;
        next += count;
        Piece { values, levels }
    })
}

fn write(
    to: &mut SerializedColumnWriter<'_>,
    column: &Column,
    names: &[ByteArray],
    piece: &Piece,
) -> Result<(), ParquetError> {
    let range = piece.values.clone();
    match &column.values {
        Values::U8(values) => put_wide(to, part(values, range), piece),
        Values::U16(values) => put_wide(to, part(values, range), piece),
        Values::I16(values) => put_wide(to, part(values, range), piece),
        Values::Small(values) => put::<Int32Type>(to, part(values, range), piece),
        Values::Float(values) => put::<FloatType>(to, part(values, range), piece),
        Values::Large(values) => {
            // The same 64 bits, whether they have a sign or not.
            let values: Vec<_> = part(values, range).iter().map(|value| *value as i64).collect();
            put::<Int64Type>(to, &values, piece)
        }
        Values::Name(values) => {
            let name = |at: &u8| names.get(usize::from(*at)).cloned().unwrap_or_default();
            let values: Vec<_> = part(values, range).iter().map(name).collect();
            put::<ByteArrayType>(to, &values, piece)
        }
        // Those without nulls have gone to `bytes`.
        Values::Bytes(ends, all) => {
            let begin = range.start.checked_sub(1).and_then(|before| ends.get(before));
            let mut begin = begin.copied().unwrap_or_default() as usize;
            let value = |end: &u32| {
                let value = all.get(begin..*end as usize).unwrap_or_default();
                begin = *end as usize;
                ByteArray::from(value.to_vec())
            };
            let values: Vec<_> = part(ends, range).iter().map(value).collect();
            put::<ByteArrayType>(to, &values, piece)
        }
    }
}

fn part<T>(values: &[T], range: Range<usize>) -> &[T] {
    values.get(range).unwrap_or_default()
}

fn put<T: DataType>(
    to: &mut SerializedColumnWriter<'_>,
    values: &[T::T],
    piece: &Piece,
) -> Result<(), ParquetError> {
    to.typed::<T>().write_batch(values, piece.levels.as_deref(), None)?;
    Ok(())
}

/// Integers for which the format has no type of their width.
fn put_wide<T: Copy + Into<i32>>(
    to: &mut SerializedColumnWriter<'_>,
    values: &[T],
    piece: &Piece,
) -> Result<(), ParquetError> {
    let values: Vec<i32> = values.iter().map(|value| (*value).into()).collect();
    put::<Int32Type>(to, &values, piece)
}

/// A column of bytes, encoded as pages. The writer of the crate takes a reference-counted buffer
/// per value, and counting takes longer than all the rest. Here all columns of bytes are required,
/// so that a page has the values alone.
fn bytes(
    description: ColumnDescPtr,
    ends: &[u32],
    all: &[u8],
) -> Result<(Bytes, ColumnCloseResult), ParquetError> {
    let mut pages = TrackedWrite::new(Vec::with_capacity(all.len() + 5 * ends.len()));
    let (mut begin, mut total) = (0, 0);
    for ends in ends.chunks(PAGE) {
        let mut page = Vec::with_capacity(all.len() / 4);
        for end in ends {
            let value = all.get(begin as usize..*end as usize).unwrap_or_default();
            page.extend_from_slice(&(*end - begin).to_le_bytes());
            page.extend_from_slice(value);
            begin = *end;
        }
        let len = page.len();
        let page = Page::DataPage {
            buf: page.into(),
            num_values: ends.len() as u32,
            encoding: Encoding::PLAIN,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        };
        let page = CompressedPage::new(page, len);
        total += SerializedPageWriter::new(&mut pages).write_page(page)?.bytes_written;
    }
    let metadata = ColumnChunkMetaData::builder(description)
        .set_encodings(vec![Encoding::PLAIN, Encoding::RLE])
        .set_num_values(ends.len() as i64)
        .set_total_compressed_size(total as i64)
        .set_total_uncompressed_size(total as i64)
        .set_data_page_offset(0)
        .build()?;
    let close = ColumnCloseResult {
        bytes_written: total,
        rows_written: ends.len() as u64,
        metadata,
        bloom_filter: None,
        column_index: None,
        offset_index: None,
    };
    Ok((pages.into_inner()?.into(), close))
}
