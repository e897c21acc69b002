//! The listing for people: aligned columns, with units.

use std::io::{self, Write};

use super::{REASONS, Skipped, Summary, number};
use crate::frame::Frame;

/// Appends the titles; `number` is that of the column with nodes or indices.
pub(crate) fn titles(out: &mut Vec<u8>, number: &str) -> io::Result<()> {
    writeln!(out, "{:>10}  {:>5}  {:<21}  {number:>5}  contents", "offset", "bytes", "message")
}

/// Appends a line with the frame at `offset`.
pub(crate) fn frame(out: &mut Vec<u8>, offset: u64, frame: &impl Frame) -> io::Result<()> {
    row(out, offset, frame.bytes().len() as u64, frame.name(), Some(frame.number()))?;
    let start = out.len();
    out.extend_from_slice(b"  ");
    write!(out, "{}", frame.contents())?;
    if out.len() == start + 2 {
        out.truncate(start);
    }
    out.push(b'\n');
    Ok(())
}

/// Appends a line with a gap.
pub(crate) fn gap(out: &mut Vec<u8>, gap: &Skipped) -> io::Result<()> {
    let Skipped { offset, length, reason, .. } = *gap;
    row(out, offset, length, "(skipped)", None)?;
    writeln!(out, "  {reason}: {}", reason.meaning())
}

/// Columns common to all lines; the longest message name has 21 characters.
fn row(
    out: &mut Vec<u8>,
    offset: u64,
    length: u64,
    message: &str,
    number: Option<u8>,
) -> io::Result<()> {
    let mut columns = [b' '; 47];
    let mut fits = number::right(&mut columns[..10], offset);
    fits &= number::right(&mut columns[12..17], length);
    if let Some(name) = columns[19..40].get_mut(..message.len()) {
        name.copy_from_slice(message.as_bytes());
    } else {
        fits = false;
    }
    if let Some(number) = number {
        fits &= number::right(&mut columns[42..], number.into());
    }
    if fits {
        out.extend_from_slice(&columns);
        return Ok(());
    }
    let number = number.map_or(String::new(), |number| number.to_string());
    write!(out, "{offset:>10}  {length:>5}  {message:<21}  {number:>5}")
}

/// Prints the byte counts.
pub(crate) fn summary(out: &mut impl Write, summary: &Summary, events: bool) -> io::Result<()> {
    let Summary { received, framed, skipped, pending, frames, counters, .. } = summary;
    if *received == 0 {
        return writeln!(out, "The input is empty: 0 bytes received, 0 frames.");
    }
    if events {
        writeln!(out)?;
    }
    writeln!(out, "{received:>10} bytes received")?;
    writeln!(out, "{framed:>10} in {frames} {}", if *frames == 1 { "frame" } else { "frames" })?;
    write!(out, "{skipped:>10} skipped")?;
    let mut before = ": ";
    for reason in REASONS {
        let bytes = counters.skipped_for(reason);
        if bytes > 0 {
            write!(out, "{before}{bytes} {reason}")?;
            before = ", ";
        }
    }
    writeln!(out)?;
    if *pending > 0 {
        writeln!(out, "{pending:>10} pending")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_does_not_fit_widens_its_column() {
        let rows = [
            (9_999_999_999, 99_999, "x", Some(255)),
            (10_000_000_000, 100_000, "y", Some(1)),
            (0, 1, "calibration_start_ack", None),
            (u64::MAX, 1, "calibration_start_ack2", None),
        ];
        for (offset, length, message, number) in rows {
            let mut text = Vec::new();
            row(&mut text, offset, length, message, number).unwrap();
            let number = number.map_or(String::new(), |number: u8| number.to_string());
            let expected = format!("{offset:>10}  {length:>5}  {message:<21}  {number:>5}");
            assert_eq!(String::from_utf8(text).unwrap(), expected);
        }
    }
}
