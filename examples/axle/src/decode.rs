//! `axle decode`: reads a byte stream, prints one line per frame and per gap.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Decoder, Event, Framing, Gap},
    ucp,
};
use clap::ValueEnum;

use crate::{
    EXIT_CODES,
    args::Protocol,
    failure::Failure,
    frame::Frame,
    input::{self, Input},
    listing::{Reasons, Skipped, Summary, json, text},
};

/// List the frames of a captured byte stream, and the gaps between them
///
/// Every input byte appears in exactly one line: a frame, or a gap with the reason why no frame
/// starts there. The end of the input counts as a quiet line: a truncated frame becomes a gap.
/// Memory use does not grow with the input.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Protocol of the line
    #[arg(long, value_enum)]
    protocol: Protocol,

    /// Ikeya: decode packets of one direction only; by default, of both
    #[arg(long, value_enum)]
    direction: Option<Direction>,

    /// Print one JSON object per line
    #[arg(long)]
    json: bool,

    /// The capture; if omitted or -, standard input
    file: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Direction {
    /// Sent by the master
    ToSlave,
    /// Sent by the slaves
    ToMaster,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let decode = match (args.protocol, args.direction) {
        (Protocol::Ucp, None) => decode::<ucp::Ucp>,
        (Protocol::Ucp, Some(_)) => {
            let line = "--direction is for ikeya and ikeya-3: UCP frames show their own direction";
            return Err(Failure::Usage(line.to_owned()));
        }
        (Protocol::Ikeya, None) => decode::<ikeya::BothDirections>,
        (Protocol::Ikeya, Some(Direction::ToSlave)) => decode::<ikeya::ToSlave>,
        (Protocol::Ikeya, Some(Direction::ToMaster)) => decode::<ikeya::ToMaster>,
        (Protocol::Ikeya3, None) => decode::<three::BothDirections>,
        (Protocol::Ikeya3, Some(Direction::ToSlave)) => decode::<three::ToSlave>,
        (Protocol::Ikeya3, Some(Direction::ToMaster)) => decode::<three::ToMaster>,
    };
    let input = Input::open(args.file.as_deref())?;
    let style = match args.json {
        true => Style::Json,
        false => Style::Text { number: args.protocol.number(), titled: false },
    };
    decode(input, Listing::new(style))
}

/// Length of the longest frame of any protocol.
pub(crate) const BUFFER_LEN: usize = ucp::MAX_LEN;

fn decode<F>(mut input: Input, mut listing: Listing) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Frame,
{
    let mut decoder = Decoder::<F, BUFFER_LEN>::new();
    let broken = loop {
        let mut bytes = match input.read() {
            Ok([]) => break None,
            Ok(bytes) => bytes,
            Err(failure) => break Some(failure),
        };
        // The source is slower than the tool: the listing may be watched live.
        let waiting = bytes.len() < input::CHUNK_LEN;
        listing.drain(&mut decoder, &mut bytes).map_err(Failure::Write)?;
        if waiting {
            listing.flush().map_err(Failure::Write)?;
        }
    };
    if let Some(failure) = broken {
        // What was decoded is still valid; the missing summary shows that it is incomplete.
        listing.flush().map_err(Failure::Write)?;
        return Err(failure);
    }
    // End of input. Each call rejects a truncated frame and continues the search inside it, so that
    // a frame behind a false header is still found (ruling B3).
    loop {
        decoder.idle();
        listing.drain(&mut decoder, &mut &[][..]).map_err(Failure::Write)?;
        if decoder.pending() == 0 {
            break;
        }
    }
    listing.finish(Summary::new(&decoder.counters(), decoder.pending())).map_err(Failure::Write)
}

/// Output style.
enum Style {
    Json,
    /// Columns; `number` is the title of that of node or index.
    Text {
        number: &'static str,
        titled: bool,
    },
}

/// Bytes of output that are collected before they are written.
const OUTPUT_LEN: usize = 64 * 1024;

/// Prints each event with its offset.
struct Listing {
    out: io::StdoutLock<'static>,
    /// Lines that are not yet written.
    lines: Vec<u8>,
    style: Style,
    /// Offset of the next event, or of the held gap.
    offset: u64,
    /// The last gap, held back: at the end of the input a second gap may follow directly, and the
    /// two are printed as one.
    gap: Option<Gap>,
    /// Counters at the end of the last gap, and of the printed gap before it.
    counted: Counters,
    printed: Counters,
}

impl Listing {
    fn new(style: Style) -> Self {
        let lines = Vec::with_capacity(OUTPUT_LEN + 4096);
        let (counted, printed) = (Counters::default(), Counters::default());
        Self { out: io::stdout().lock(), lines, style, offset: 0, gap: None, counted, printed }
    }

    /// Prints all events in `bytes`.
    fn drain<F, const N: usize>(
        &mut self,
        decoder: &mut Decoder<F, N>,
        bytes: &mut &[u8],
    ) -> io::Result<()>
    where
        F: Framing,
        for<'a> F::Frame<'a>: Frame,
    {
        loop {
            let gap = match decoder.decode(bytes) {
                None => return Ok(()),
                Some(Event::Frame(frame)) => {
                    self.end_gap()?;
                    self.frame(&frame)?;
                    continue;
                }
                Some(Event::Skipped(gap)) => gap,
            };
            match &mut self.gap {
                Some(held) => held.len += gap.len,
                None => self.gap = Some(gap),
            }
            // No later gap is counted before this one is reported.
            self.counted = decoder.counters();
        }
    }

    fn frame(&mut self, frame: &impl Frame) -> io::Result<()> {
        self.titles()?;
        match self.style {
            Style::Json => json::frame(&mut self.lines, self.offset, frame)?,
            Style::Text { .. } => text::frame(&mut self.lines, self.offset, frame)?,
        }
        self.offset += frame.bytes().len() as u64;
        self.write_full()
    }

    fn end_gap(&mut self) -> io::Result<()> {
        let Some(Gap { len: length, reason }) = self.gap.take() else { return Ok(()) };
        let reasons = Reasons::between(&self.printed, &self.counted);
        self.printed = self.counted;
        let gap = Skipped { offset: self.offset, length, reason, reasons };
        self.offset += length;
        self.titles()?;
        match self.style {
            Style::Json => json::gap(&mut self.lines, &gap)?,
            Style::Text { .. } => text::gap(&mut self.lines, &gap)?,
        }
        self.write_full()
    }

    /// Prints the titles before the first event.
    fn titles(&mut self) -> io::Result<()> {
        match &mut self.style {
            Style::Text { number, titled: titled @ false } => {
                *titled = true;
                text::titles(&mut self.lines, number)
            }
            _ => Ok(()),
        }
    }

    fn finish(&mut self, summary: Summary) -> io::Result<()> {
        self.end_gap()?;
        match self.style {
            Style::Json => json::summary(&mut self.lines, &summary)?,
            Style::Text { titled, .. } => text::summary(&mut self.lines, &summary, titled)?,
        }
        self.flush()
    }

    /// Writes the lines if there are enough.
    fn write_full(&mut self) -> io::Result<()> {
        if self.lines.len() < OUTPUT_LEN {
            return Ok(());
        }
        self.write()
    }

    fn write(&mut self) -> io::Result<()> {
        let written = self.out.write_all(&self.lines);
        self.lines.clear();
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        self.write()?;
        self.out.flush()
    }
}
