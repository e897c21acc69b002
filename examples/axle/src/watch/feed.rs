//! The bytes of a line on their way into the model.

use axlewire::{
    ikeya::NodeId,
    stream::{Counters, Decoder, Event, Framing},
};

use super::model::{Heard, Model};
use crate::{
    decode::BUFFER_LEN,
    line::QUIET,
    listing::{Shown, Table},
};

/// Where bytes come from.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Source {
    Received,
    /// By this tool.
    Sent,
}

/// Decoders and the model that they fill.
pub(crate) struct Feed<F> {
    received: Direction<F>,
    sent: Direction<F>,
    pub(crate) model: Model,
    /// Counts the messages, for a summary at the end.
    table: Option<Table>,
}

/// The bytes of one source. They are no part of the frames of the other.
struct Direction<F> {
    decoder: Decoder<F, BUFFER_LEN>,
    heard_at: u64,
    /// Number of bytes in the events so far.
    reported: u64,
    /// The node that the bytes behind them are near.
    near: Option<NodeId>,
}

impl<F> Direction<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Heard,
{
    fn new() -> Self {
        Self { decoder: Decoder::new(), heard_at: 0, reported: 0, near: None }
    }

    /// Whether there are bytes that may become part of a frame, or of a longer gap.
    const fn is_open(&self) -> bool {
        self.decoder.received() > self.reported
    }

    fn take(&mut self, bytes: &[u8], at: u64, model: &mut Model, table: &mut Option<Table>) {
        if !bytes.is_empty() {
            self.heard_at = at;
        } else if self.is_open() && at >= self.heard_at + u64::from(QUIET.as_micros()) {
            self.decoder.idle();
        } else {
            return;
        }
        let mut bytes = bytes;
        // Pending bytes belong near an earlier packet than those that follow.
        let mut near = self.near.take();
        while let Some(event) = self.decoder.decode(&mut bytes) {
            match event {
                Event::Frame(frame) => {
                    near = None;
                    self.reported += frame.bytes().len() as u64;
                    if let Some(table) = table {
                        table.count(&frame);
                    }
                    model.frame(&frame, at);
                }
                Event::Skipped(gap) => {
                    self.reported += gap.len;
                    let near = near.take().or_else(|| model.near());
                    model.gap(gap, near, at);
                }
            }
        }
        if self.is_open() {
            self.near = near.or_else(|| model.near());
        }
    }
}

impl<F> Feed<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Heard,
{
    pub(crate) fn new(model: Model, table: Option<Table>) -> Self {
        Self { received: Direction::new(), sent: Direction::new(), model, table }
    }

    /// Takes in bytes, at a time in microseconds. No bytes may mean that a partial frame has ended
    /// (ruling B3).
    pub(crate) fn take(&mut self, source: Source, bytes: &[u8], at: u64) {
        let direction = match source {
            Source::Received => &mut self.received,
            Source::Sent => &mut self.sent,
        };
        direction.take(bytes, at, &mut self.model, &mut self.table);
    }

    /// Takes in the time.
    pub(crate) fn tick(&mut self, now: u64) {
        for source in [Source::Received, Source::Sent] {
            self.take(source, &[], now);
        }
        let counters = self.counters();
        self.model.tick(counters, now);
    }

    /// The account of all bytes.
    pub(crate) fn counters(&self) -> Counters {
        let mut counters = self.received.decoder.counters();
        counters += self.sent.decoder.counters();
        counters
    }

    /// The counts, if there are any.
    pub(crate) fn into_table(self) -> Option<Table> {
        self.table
    }
}

#[cfg(test)]
mod tests;
