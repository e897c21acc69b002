//! JSON lines, described by `decode.schema.json`.

use serde::Serialize;

use super::{Skipped, Summary, number};
use crate::frame::Frame;

/// Appends a line with event, offset and the fields of the frame.
pub(crate) fn frame(
    out: &mut Vec<u8>,
    offset: u64,
    frame: &impl Frame,
) -> Result<(), serde_json::Error> {
    out.extend_from_slice(br#"{"event":"frame","offset":"#);
    number::append(out, offset);
    fields(out, frame)?;
    out.extend_from_slice(b"}\n");
    Ok(())
}

/// Appends the fields of the frame to an object that has some and is not closed.
pub(crate) fn fields(out: &mut Vec<u8>, frame: &impl Frame) -> Result<(), serde_json::Error> {
    // An object of its own, without its braces: flattening would take longer.
    let start = out.len();
    serde_json::to_writer(&mut *out, frame)?;
    out[start] = b',';
    out.pop();
    Ok(())
}

/// Appends a line with a gap.
pub(crate) fn gap(out: &mut Vec<u8>, gap: &Skipped) -> Result<(), serde_json::Error> {
    event(out, "skipped", gap)
}

/// Appends a line with the byte counts.
pub(crate) fn summary(out: &mut Vec<u8>, summary: &Summary) -> Result<(), serde_json::Error> {
    event(out, "summary", summary)
}

fn event(
    out: &mut Vec<u8>,
    event: &'static str,
    fields: &impl Serialize,
) -> Result<(), serde_json::Error> {
    #[derive(Serialize)]
    struct Event<'a, T> {
        event: &'static str,
        #[serde(flatten)]
        fields: &'a T,
    }
    serde_json::to_writer(&mut *out, &Event { event, fields })?;
    out.push(b'\n');
    Ok(())
}
