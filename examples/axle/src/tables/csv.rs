//! Rows of a table as lines of CSV.

use super::column::{Cell, Column};
use crate::listing::{self, Out};

/// The first line.
pub(crate) fn titles(columns: &[Column]) -> Out {
    let names: Vec<_> = columns.iter().map(|column| &*column.name).collect();
    let mut out = Out::default();
    out.text(&names.join(","));
    out.text("\n");
    out
}

/// The line of each row.
pub(crate) fn each_line<E>(
    columns: &[Column],
    rows: usize,
    mut line: impl FnMut(&[u8]) -> Result<(), E>,
) -> Result<(), E> {
    let mut out = Out::default();
    let mut columns: Vec<_> = columns.iter().map(Column::cells).collect();
    for _ in 0..rows {
        let mut before = "";
        for column in &mut columns {
            out.text(before);
            before = ",";
            if let Some(cell) = column.next().flatten() {
                print(&mut out, cell);
            }
        }
        out.text("\n");
        line(&out.0)?;
        out.0.clear();
    }
    Ok(())
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
        Cell::Time(micros) => listing::seconds(out, micros),
        Cell::Name(name) => out.text(name),
        Cell::Bytes(bytes) => {
            let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 0x0F]);
            out.0.extend(
                digits.map(|digit| b"0123456789abcdef".get(usize::from(digit)).unwrap_or(&0)),
            );
        }
    }
}
