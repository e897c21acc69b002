//! The traffic per kind of message, as a table, as a line and as JSON.

use std::{
    collections::BTreeMap,
    io::{self, Write},
};

use axlewire::{
    stream::{Counters, Decoder, Event, Framing},
    time::{Duration, Instant},
};
use serde::Serialize;

use super::{Modes, Out, REASONS, Shown, pending, print_summary};
use crate::args::Protocol;

/// The time over which a rate is measured.
const RATE_PERIOD: Duration = Duration::from_secs(1);

/// Traffic per message. There are few kinds of messages, so the table stays small.
pub(crate) struct Table {
    protocol: Protocol,
    rows: BTreeMap<(u8, &'static str), Row>,
    start: Instant,
    measured_at: Instant,
    /// Modes on the only line.
    modes: Modes,
}

/// One kind of message of one node.
#[derive(Default)]
struct Row {
    count: u64,
    /// `count` at the last rate measurement.
    measured: u64,
    per_second: f64,
    last: String,
}

/// The line of `--json`.
#[derive(Serialize)]
struct Record<'a> {
    event: &'static str,
    /// Seconds since the start.
    t: f64,
    received: u64,
    framed: u64,
    skipped: u64,
    pending: u64,
    frames: u64,
    skipped_by: BTreeMap<&'static str, u64>,
    messages: Vec<Message<'a>>,
}

#[derive(Serialize)]
struct Message<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    node: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<u8>,
    message: &'static str,
    count: u64,
    per_second: f64,
    last: &'a str,
}

impl Table {
    pub(crate) fn new(protocol: Protocol, now: Instant) -> Self {
        Self {
            protocol,
            rows: BTreeMap::new(),
            start: now,
            measured_at: now,
            modes: Modes::default(),
        }
    }

    /// Counts the frames in `bytes`.
    pub(crate) fn take<F, const N: usize>(&mut self, decoder: &mut Decoder<F, N>, mut bytes: &[u8])
    where
        F: Framing,
        for<'a> F::Frame<'a>: Shown,
    {
        while let Some(event) = decoder.decode(&mut bytes) {
            // Gaps are already in the counters.
            if let Event::Frame(frame) = event {
                self.count(&frame);
            }
        }
    }

    /// Counts a frame of the only line.
    pub(crate) fn count(&mut self, frame: &impl Shown) {
        frame.teach(&mut self.modes);
        let modes = self.modes;
        self.count_in(frame, &modes);
    }

    /// Counts a frame of a line whose nodes have these modes.
    pub(crate) fn count_in(&mut self, frame: &impl Shown, modes: &Modes) {
        let row = self.rows.entry((frame.key(), frame.name())).or_default();
        row.count += 1;
        // The same memory again: a full bus has thousands of frames a second.
        let mut contents = Out(core::mem::take(&mut row.last).into_bytes());
        contents.0.clear();
        frame.contents(&mut contents, modes);
        row.last = String::from_utf8(contents.0).unwrap_or_default();
    }

    /// Measures the rates, once per period.
    pub(crate) fn measure(&mut self, now: Instant) {
        if now < self.measured_at + RATE_PERIOD {
            return;
        }
        let seconds = f64::from((now - self.measured_at).as_micros()) / 1e6;
        self.measured_at = now;
        for row in self.rows.values_mut() {
            row.per_second = (row.count - row.measured) as f64 / seconds;
            row.measured = row.count;
        }
    }

    /// The title of the first column.
    const fn key(&self) -> &'static str {
        match self.protocol {
            Protocol::Ucp => "id",
            Protocol::Ikeya | Protocol::Ikeya3 => "node",
        }
    }

    /// The titles and the rows.
    fn lines(&self) -> impl Iterator<Item = String> {
        let title =
            format!("{:>4}  {:<21}  {:>9}  {:>8}  last", self.key(), "message", "count", "per s");
        let rows = self.rows.iter().map(|((key, message), row)| {
            let Row { count, per_second, last, .. } = row;
            format!("{key:>4}  {message:<21}  {count:>9}  {per_second:>8.1}  {last}")
        });
        [title].into_iter().chain(rows)
    }

    /// The rates on one line.
    pub(crate) fn print_line(
        &self,
        out: &mut impl Write,
        counters: &Counters,
        now: Instant,
    ) -> io::Result<()> {
        write!(out, "{:5} s  {}", self.micros(now) / 1_000_000, account(counters))?;
        for ((key, message), row) in &self.rows {
            write!(out, "; {} {key} {message} {:.1}/s", self.key(), row.per_second)?;
        }
        writeln!(out)?;
        out.flush()
    }

    /// The same as a JSON object.
    pub(crate) fn print_json(
        &self,
        out: &mut impl Write,
        event: &'static str,
        counters: &Counters,
        now: Instant,
    ) -> io::Result<()> {
        let skipped = REASONS.into_iter().map(|reason| (reason, counters.skipped_for(reason)));
        let is_bus = self.protocol != Protocol::Ucp;
        let record = Record {
            event,
            t: self.micros(now) as f64 / 1e6,
            received: counters.received,
            framed: counters.framed,
            skipped: counters.skipped(),
            pending: pending(counters),
            frames: counters.frames,
            skipped_by: skipped
                .filter(|(_, bytes)| *bytes > 0)
                .map(|(reason, bytes)| (reason.name(), bytes))
                .collect(),
            messages: self
                .rows
                .iter()
                .map(|(&(key, message), row)| Message {
                    node: is_bus.then_some(key),
                    id: (!is_bus).then_some(key),
                    message,
                    count: row.count,
                    per_second: row.per_second,
                    last: &row.last,
                })
                .collect(),
        };
        serde_json::to_writer(&mut *out, &record)?;
        writeln!(out)?;
        out.flush()
    }

    /// The rates of the whole run.
    pub(crate) fn measure_all(&mut self, now: Instant) {
        let seconds = self.micros(now) as f64 / 1e6;
        for row in self.rows.values_mut() {
            row.per_second = if seconds > 0.0 { row.count as f64 / seconds } else { 0.0 };
        }
    }

    /// The table with the rates of the whole run, and the byte counts.
    pub(crate) fn finish(
        &mut self,
        out: &mut impl Write,
        counters: &Counters,
        now: Instant,
    ) -> io::Result<()> {
        self.measure_all(now);
        if !self.rows.is_empty() {
            for line in self.lines() {
                writeln!(out, "{line}")?;
            }
        }
        if counters.received == 0 {
            writeln!(out, "Nothing was heard in {:.0} s.", self.micros(now) as f64 / 1e6)?;
        } else {
            print_summary(out, counters, !self.rows.is_empty())?;
        }
        out.flush()
    }

    /// Time since the start, microseconds.
    const fn micros(&self, now: Instant) -> u64 {
        now.as_micros() - self.start.as_micros()
    }
}

/// The byte counts on one line.
fn account(counters: &Counters) -> String {
    let mut text = format!("{} bytes, {} frames", counters.received, counters.frames);
    text.push_str(&format!(", {} skipped", counters.skipped()));
    for reason in REASONS.into_iter().filter(|reason| counters.skipped_for(*reason) > 0) {
        text.push_str(&format!(" {reason} {}", counters.skipped_for(reason)));
    }
    text
}

#[cfg(test)]
mod tests;
