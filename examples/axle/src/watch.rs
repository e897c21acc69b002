//! `axle watch`: shows the traffic on a line live, without sending anything.

use std::{
    collections::BTreeMap,
    io::{self, IsTerminal, Write},
    time::Duration as Span,
};

use axlewire::{
    drive::Clock,
    ikeya::{self, three},
    stream::{Counters, Decoder, Event, Framing},
    time::{Duration, Instant},
    ucp,
};

use crate::{
    MOTION_HELP,
    args::{self, Protocol},
    decode::BUFFER_LEN,
    failure::Failure,
    line::Line,
    listing::{self, Modes, Out, REASONS, Shown},
    signals::Signals,
};

/// Watch a line without sending anything
///
/// Decodes both directions and shows how often each message of each node is heard, its last
/// contents, and how many bytes were skipped and why. On a terminal the table is redrawn in place;
/// elsewhere one line is printed per second. Ctrl-C ends with a summary.
///
/// It sends no requests, so it shows existing traffic only: robots report by themselves, nodes of a
/// motor bus answer only to a master, and on a four-wire bus an adapter hears one direction.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// Protocol of the line
    #[arg(long, value_enum)]
    protocol: Protocol,
}

/// Intervals at which the table is redrawn and a line is printed.
const REDRAW_PERIOD: Duration = Duration::from_millis(250);
const PRINT_PERIOD: Duration = Duration::from_millis(1000);

/// The time over which a rate is measured.
const RATE_PERIOD: Duration = Duration::from_millis(1000);

/// Longest wait for bytes, so that signals are noticed in time.
const PATIENCE: Duration = Duration::from_millis(50);

/// Silence that ends a partial frame (ruling B3): longer than the pauses of a USB adapter.
const QUIET: Duration = Duration::from_millis(30);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    match args.protocol {
        Protocol::Ucp => watch::<ucp::Ucp>(args, &signals),
        Protocol::Ikeya => watch::<ikeya::BothDirections>(args, &signals),
        Protocol::Ikeya3 => watch::<three::BothDirections>(args, &signals),
    }
}

fn watch<F>(args: &Args, signals: &Signals) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let mut line = Line::open(&args.line, args.protocol)?;
    let mut clock = line.clock();
    let mut buffer = [0; 4096];
    let mut out = io::stdout().lock();
    let is_live = out.is_terminal();
    let mut decoder = Decoder::<F, BUFFER_LEN>::new();
    let mut table = Table::new(args.protocol, clock.now());
    let period = if is_live { REDRAW_PERIOD } else { PRINT_PERIOD };
    let (mut print_at, mut heard_at) = (clock.now() + period, clock.now());

    let broken = loop {
        if signals.is_raised() {
            break Ok(());
        }
        let patience = (print_at - clock.now()).min(PATIENCE).as_micros();
        let received = match line.receive(&mut buffer, Span::from_micros(patience.into())) {
            Ok(received) => received,
            Err(failure) => break Err(failure),
        };
        let now = clock.now();
        if !received.is_empty() {
            heard_at = now;
        } else if now >= heard_at + QUIET && decoder.pending() > 0 {
            decoder.idle();
        }
        table.take(&mut decoder, received);
        if now >= print_at {
            print_at = now + period;
            table.measure(now);
            let printed = match is_live {
                true => table.redraw(&mut out, &decoder.counters()),
                false => table.print_line(&mut out, &decoder.counters(), now),
            };
            printed.map_err(Failure::Write)?;
        }
    };
    table
        .finish(&mut out, &decoder.counters(), decoder.pending(), clock.now())
        .map_err(Failure::Write)?;
    broken
}

/// Traffic per message. There are few kinds of messages, so the table stays small.
struct Table {
    protocol: Protocol,
    rows: BTreeMap<(u8, &'static str), Row>,
    start: Instant,
    measured_at: Instant,
    modes: Modes,
    /// Number of lines on the screen that the next table replaces.
    drawn: usize,
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

impl Table {
    fn new(protocol: Protocol, now: Instant) -> Self {
        Self {
            protocol,
            rows: BTreeMap::new(),
            start: now,
            measured_at: now,
            modes: Modes::default(),
            drawn: 0,
        }
    }

    /// Counts the frames in `bytes`.
    fn take<F>(&mut self, decoder: &mut Decoder<F, BUFFER_LEN>, mut bytes: &[u8])
    where
        F: Framing,
        for<'a> F::Frame<'a>: Shown,
    {
        while let Some(event) = decoder.decode(&mut bytes) {
            // Gaps are already in the counters.
            let Event::Frame(frame) = event else { continue };
            frame.teach(&mut self.modes);
            let mut contents = Out::default();
            frame.contents(&mut contents, &self.modes);
            let row = self.rows.entry((frame.key(), frame.name())).or_default();
            row.count += 1;
            row.last = String::from_utf8(contents.0).unwrap_or_default();
        }
    }

    /// Measures the rates, once per period.
    fn measure(&mut self, now: Instant) {
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

    /// Replaces the table on the screen.
    fn redraw(&mut self, out: &mut impl Write, counters: &Counters) -> io::Result<()> {
        let mut text = String::new();
        for line in self.lines() {
            // Lines are cut at the screen edge, not wrapped: the next table expects one row per
            // line.
            text.push_str(&format!("{line}\n"));
        }
        text.push_str(&format!("{}\n", account(counters)));
        let up = match self.drawn {
            0 => String::new(),
            lines => format!("\x1b[{lines}A\x1b[J"),
        };
        self.drawn = self.rows.len() + 2;
        write!(out, "\x1b[?7l{up}{text}\x1b[?7h")?;
        out.flush()
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
    fn print_line(
        &self,
        out: &mut impl Write,
        counters: &Counters,
        now: Instant,
    ) -> io::Result<()> {
        write!(out, "{:5} s  {}", (now - self.start).as_micros() / 1_000_000, account(counters))?;
        for ((key, message), row) in &self.rows {
            write!(out, "; {} {key} {message} {:.1}/s", self.key(), row.per_second)?;
        }
        writeln!(out)?;
        out.flush()
    }

    /// The table with the rates of the whole run, and the byte counts.
    fn finish(
        &mut self,
        out: &mut impl Write,
        counters: &Counters,
        pending: usize,
        now: Instant,
    ) -> io::Result<()> {
        let seconds = f64::from((now - self.start).as_micros()) / 1e6;
        for row in self.rows.values_mut() {
            row.per_second = row.count as f64 / seconds;
        }
        if self.drawn > 0 {
            self.redraw(out, counters)?;
        } else if !self.rows.is_empty() {
            for line in self.lines() {
                writeln!(out, "{line}")?;
            }
        }
        if counters.received == 0 {
            writeln!(out, "Nothing was heard in {seconds:.0} s.")?;
        } else {
            listing::print_summary(out, counters, pending, !self.rows.is_empty())?;
        }
        out.flush()
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
