//! MCAP: a topic per message, whose messages are the lines of `axle decode --json`.

use std::{collections::BTreeMap, io::BufWriter};

use mcap::{WriteOptions, Writer, records::MessageHeader};

use super::job::Job;
use crate::{
    args::Protocol,
    beside::{Beside, cannot_write},
    decode::{Sheet, Walked},
    failure::Failure,
    listing::Style,
    tables,
};

pub(super) fn export(mut job: Job<'_>) -> Result<Walked, Failure> {
    let (beside, file) = Beside::file(job.output, job.force, &job.input)?;
    beside.end_on(&job.signals);
    let cannot = |error: mcap::McapError| match error {
        // What the system says, such as that the disk is full.
        mcap::McapError::Io(error) => cannot_write(job.output, &error),
        error => cannot_write(job.output, &error),
    };
    let options = WriteOptions::new().compression(None).library("axle");
    let writer = options.create(BufWriter::new(file)).map_err(cannot)?;
    let mut topics = Topics { writer, known: BTreeMap::new(), count: 0, latest: None };
    let mut sheet = Sheet::new(Some(Style::Json));
    sheet.marks = Some(Vec::new());
    let write = |topics: &mut Topics, sheet: &mut Sheet| topics.write(sheet).map_err(cannot);
    let walked = job.chosen.walk(&mut job.input, &mut sheet, |_, sheet| {
        Job::go_on(&job.signals)?;
        write(&mut topics, sheet)
    })?;
    write(&mut topics, &mut sheet)?;
    topics.writer.finish().map_err(cannot)?;
    let file = topics.writer.into_inner();
    drop(file.into_inner().map_err(|error| cannot(error.into_error().into()))?);
    beside.keep()?;
    Ok(walked)
}

/// The messages of a file, and the topics that it has so far.
struct Topics {
    writer: Writer<BufWriter<std::fs::File>>,
    known: BTreeMap<(Option<&'static str>, &'static str), u16>,
    count: u32,
    /// The last time so far, nanoseconds.
    latest: Option<u64>,
}

impl Topics {
    /// Writes the lines of a sheet, and empties it.
    fn write(&mut self, sheet: &mut Sheet) -> Result<(), mcap::McapError> {
        let mut begin = 0;
        for mark in sheet.marks.iter_mut().flat_map(|marks| marks.drain(..)) {
            let line = sheet.out.0.get(begin..mark.end).unwrap_or_default();
            begin = mark.end;
            let channel_id = self.topic(mark.protocol, mark.message)?;
            if let Some(micros) = mark.at.micros {
                self.latest = Some(micros.saturating_mul(1000));
            }
            // A packet without a time has that of the line before it. Raw bytes have none at all: a
            // nanosecond per byte keeps their order.
            let nanos = self.latest.unwrap_or(mark.at.offset);
            let sequence = self.count;
            self.count = self.count.wrapping_add(1);
            let header =
                MessageHeader { channel_id, sequence, log_time: nanos, publish_time: nanos };
            self.writer.write_to_known_channel(&header, line.trim_ascii_end())?;
        }
        sheet.out.0.clear();
        Ok(())
    }

    fn topic(
        &mut self,
        protocol: Option<Protocol>,
        message: &'static str,
    ) -> Result<u16, mcap::McapError> {
        let key = (protocol.map(Protocol::name), message);
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        let name = tables::name(protocol, message);
        let schema = tables::json_schema(protocol, message);
        let schema = self.writer.add_schema(&name, "jsonschema", schema.as_bytes())?;
        let id = self.writer.add_channel(schema, &name, "json", &BTreeMap::new())?;
        self.known.insert(key, id);
        Ok(id)
    }
}
