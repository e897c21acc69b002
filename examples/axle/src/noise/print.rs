//! The results: a table, or an object for each stream and decoder.

use std::io::{self, Write};

use serde::Serialize;

use super::{noisy_line::Tally, receiver::Receiver};

/// What a receiver has made of a stream.
#[derive(Debug)]
pub(super) struct Row<'a> {
    pub(super) stream: &'a str,
    pub(super) receiver: Receiver,
    pub(super) frames: u32,
    pub(super) tally: Tally,
}

/// The object of --json.
#[derive(Serialize)]
struct Record<'a> {
    stream: &'a str,
    decoder: &'a str,
    frames: u32,
    intact: usize,
    delivered: usize,
    phantoms: usize,
    unavoidable: usize,
}

impl Row<'_> {
    /// What is wrong with a decoder of the library.
    pub(super) fn fault(&self) -> Option<String> {
        if !self.receiver.is_ours() || self.tally.is_perfect() {
            return None;
        }
        let Tally { intact, delivered, invented, .. } = self.tally;
        let (who, lost) = (self.receiver.name(), intact - delivered);
        let plural = |count| if count == 1 { "" } else { "s" };
        Some(match (lost, invented) {
            (0, _) => format!(
                "{}: {who} has delivered {invented} phantom{} that the noise has not made",
                self.stream,
                plural(invented)
            ),
            _ => format!("{}: {who} has lost {lost} intact frame{}", self.stream, plural(lost)),
        })
    }

    fn json(&self, out: &mut impl Write) -> io::Result<()> {
        let Tally { intact, delivered, phantoms, unavoidable, .. } = self.tally;
        let (stream, frames, decoder) = (self.stream, self.frames, &*self.receiver.name());
        let record = Record { stream, decoder, frames, intact, delivered, phantoms, unavoidable };
        serde_json::to_writer(&mut *out, &record)?;
        writeln!(out)
    }
}

/// Prints results as they come.
pub(super) struct Table {
    is_json: bool,
    /// The sum of all streams, for each receiver.
    totals: Vec<(Receiver, Tally)>,
    streams: usize,
}

/// Widths of the columns for names of streams, for counts, and for those of accidents.
const NAME: usize = 22;
const COUNT: usize = 8;
const ACCIDENTS: usize = 13;

impl Table {
    pub(super) fn new(is_json: bool, receivers: &[Receiver]) -> Self {
        let totals = receivers.iter().map(|&receiver| (receiver, Tally::default())).collect();
        Self { is_json, totals, streams: 0 }
    }

    pub(super) fn titles(&self, out: &mut impl Write) -> io::Result<()> {
        if self.is_json {
            return Ok(());
        }
        let shares: usize = self.totals.iter().map(|(receiver, _)| width(*receiver)).sum();
        let start = NAME + COUNT;
        writeln!(out, "{:start$}  {:shares$}phantoms", "", "% of the intact frames delivered")?;
        write!(out, "{:NAME$}{:>COUNT$}", "stream", "intact")?;
        for &(receiver, _) in &self.totals {
            write!(out, "{:>1$}", title(receiver), width(receiver))?;
        }
        writeln!(out, "{:>COUNT$}{:>COUNT$}{:>ACCIDENTS$}", "ours", "plain", "unavoidable")
    }

    pub(super) fn stream(&mut self, out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
        self.streams += 1;
        for ((_, total), Row { tally, .. }) in self.totals.iter_mut().zip(rows) {
            total.intact += tally.intact;
            total.delivered += tally.delivered;
            total.phantoms += tally.phantoms;
            total.unavoidable += tally.unavoidable;
        }
        if self.is_json {
            return rows.iter().try_for_each(|row| row.json(out));
        }
        let name = rows.first().map_or("", |row| row.stream);
        let tallies: Vec<_> = rows.iter().map(|row| (row.receiver, row.tally)).collect();
        line(out, name, &tallies)
    }

    pub(super) fn totals(&self, out: &mut impl Write) -> io::Result<()> {
        if self.is_json || self.streams < 2 {
            return Ok(());
        }
        line(out, "all", &self.totals)
    }
}

fn line(out: &mut impl Write, name: &str, tallies: &[(Receiver, Tally)]) -> io::Result<()> {
    // The same for all.
    let Tally { intact, unavoidable, .. } =
        tallies.first().map_or(Tally::default(), |(_, tally)| *tally);
    write!(out, "{name:NAME$}{intact:>COUNT$}")?;
    for (receiver, tally) in tallies {
        write!(out, "{:>1$}", share(tally), width(*receiver))?;
    }
    let most = |is_ours| {
        let these = tallies.iter().filter(|(receiver, _)| receiver.is_ours() == is_ours);
        these.map(|(_, tally)| tally.phantoms).max().unwrap_or(0)
    };
    writeln!(out, "{:>COUNT$}{:>COUNT$}{unavoidable:>ACCIDENTS$}", most(true), most(false))
}

/// The title of a receiver's column.
fn title(receiver: Receiver) -> String {
    match receiver {
        Receiver::Frames => "Frames".to_owned(),
        Receiver::EachSimd => "each".to_owned(),
        Receiver::EachPortable => "portable".to_owned(),
        Receiver::Decoder(chunk) => format!("by {chunk}"),
        Receiver::Pushed => "pushed".to_owned(),
        other => other.name(),
    }
}

fn width(receiver: Receiver) -> usize {
    title(receiver).len().max("99.99".len()) + 2
}

/// Percent of the intact frames. 100 means all of them: never rounded up.
fn share(tally: &Tally) -> String {
    if tally.delivered >= tally.intact {
        return "100".to_owned();
    }
    let hundredths = tally.delivered * 10_000 / tally.intact;
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

#[cfg(test)]
mod tests;
