//! `axle decode`: reads a capture, prints one line per frame and per gap.

mod account;
mod capture;
mod detect;
mod framing;
mod parallel;
mod printer;
mod stream;
mod walk;
mod whole;

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
    thread,
};

use axlewire::stream::{Counters, Framing};
use clap::{ValueEnum, builder::PossibleValue};

use crate::{
    EXIT_CODES,
    args::Protocol,
    failure::Failure,
    input::{self, Input},
    listing::{Modes, Shown, Style, TimeColumn},
    pcapng,
};
use detect::{Guess, Share};
pub(crate) use framing::Choice;
use framing::for_framing;
use printer::Printer;
#[cfg(all(test, feature = "mcap"))]
pub(crate) use stream::Mark;
use stream::StreamOf;
pub(crate) use stream::{BUFFER_LEN, Sheet, Stream, Taken};
pub(crate) use walk::{Next, Walked, walk};
pub(crate) use whole::{Chosen, choose, walk_into};

/// The most threads that are used: each has its own buffers, and the more there are, the shorter
/// are the parts of the file.
const MOST_JOBS: usize = 16;

/// List the frames of a capture, and the gaps between them
///
/// Reads raw bytes, or pcapng as `axle record` writes it; standard input too. Every byte appears in
/// exactly one line: a frame, or a gap with the reason why no frame starts there. The end of the
/// input, or of a section of pcapng, counts as a quiet line: a truncated frame becomes a gap. Times
/// do not: how long a line was quiet cannot be told from the moments at which its bytes were read.
/// Memory use does not grow with the input.
///
/// The time of a frame is that of its last byte: of the moment when the recording program got it
/// from the system, with all bytes of the same chunk. Behind a USB adapter, that can be 16 ms after
/// it was on the line. Raw bytes have no times.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Protocol of the line; auto takes that of a pcapng file, or the one whose frames have the
    /// most bytes at the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    protocol: Named,

    /// Ikeya: decode packets of one direction only; by default, of both
    #[arg(short, long, value_enum)]
    direction: Option<Direction>,

    /// Print one JSON object per line; t is in seconds since 1970
    #[arg(short, long)]
    json: bool,

    /// Print the byte counts only
    #[arg(short, long)]
    summary: bool,

    /// Time column, if the capture has times
    #[arg(short, long, value_enum, default_value = "relative")]
    time: TimeColumn,

    /// Threads for a file of raw bytes, at most 16 of which are used; by default, as many as there
    /// are cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,

    /// The capture; if omitted or -, standard input
    file: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Direction {
    /// Sent by the master
    ToSlave,
    /// Sent by the slaves
    ToMaster,
}

/// What `--protocol` accepts: a protocol, or `None` for auto.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Named(pub(crate) Option<Protocol>);

impl ValueEnum for Named {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [Named; 4] = [
            Named(None),
            Named(Some(Protocol::Ucp)),
            Named(Some(Protocol::Ikeya)),
            Named(Some(Protocol::Ikeya3)),
        ];
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let auto = || Some(PossibleValue::new("auto").help("Find it out"));
        self.0.as_ref().map_or_else(auto, Protocol::to_possible_value)
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let choice = Choice { protocol: args.protocol.0, direction: args.direction };
    if let Some(protocol) = choice.protocol {
        choice.permits(protocol)?;
    }
    let mut input = Input::open(args.file.as_deref())?;
    if input.is_pcapng()? {
        return capture::run(args, input, choice);
    }
    let protocol = match choice.protocol {
        Some(protocol) => protocol,
        None => detected(args, choice, &mut input)?,
    };
    // For a hint at the end, if there are no frames.
    input.keep_first(detect::SAMPLE_LEN);
    let run = for_framing!(decode, protocol, choice.direction);
    let account = run(args, protocol, &mut input)?;
    if account.frames == 0 && account.received > 0 {
        return Err(Failure::Failed(no_frame(protocol, &account, &detect::shares(input.first()))));
    }
    Ok(())
}

/// A stream of this protocol, in one direction of a line.
pub(crate) fn stream_of(protocol: Protocol, direction: pcapng::Direction) -> Box<dyn Stream> {
    Choice::default().stream(protocol, None, Some(direction))
}

/// All frames of a capture of one line, and the modes of its nodes. `chosen` is needed for raw
/// bytes.
///
/// The frames are for one line again. So there may be no other in the capture, and no doubt about
/// how a command was meant: its node must not have changed its mode (ruling I3).
pub(crate) fn frames_of(
    path: &Path,
    chosen: Option<Protocol>,
) -> Result<(Protocol, Vec<Taken>, Modes), Failure> {
    let mut input = Input::open(Some(path))?;
    let mut sheet = Sheet::new(None);
    sheet.taken = Some(Default::default());
    let choice = Choice { protocol: chosen, direction: None };
    let mut found = None;
    let walked = walk(&mut input, choice, &mut sheet, |next, _| {
        let (_, interface) = *found.get_or_insert((next.protocol, next.interface));
        if interface != next.interface {
            return Err(Failure::Failed(format!("{path:?} has more than one line")));
        }
        Ok(true)
    });
    if let Some(failure) = walked.broken {
        return Err(failure);
    }
    let protocol = found.map(|(protocol, _)| protocol).or(chosen);
    let protocol = protocol.ok_or_else(|| Failure::Failed(format!("{path:?} has no bytes")))?;
    let (taken, turned) = sheet.taken.unwrap_or_default();
    let mut commanded = taken.iter().filter_map(|taken| taken.commands);
    if let Some(node) = commanded.find(|node| turned.contains(node)) {
        let line = format!("node {node} changes its mode in {path:?}: its commands are ambiguous");
        return Err(Failure::Failed(line));
    }
    Ok((protocol, taken, walked.modes))
}

/// What to say if there was no frame of `protocol`.
fn no_frame(protocol: Protocol, account: &Counters, shares: &[Share; 3]) -> String {
    let (name, received) = (protocol.name(), account.received);
    let plain = format!("no {name} frame in {received} bytes");
    match shares.first() {
        Some(best) if best.framed > 0 => {
            let (found, frames) = (best.protocol.name(), best.frames);
            format!("{plain}, but {frames} of {found}: use --protocol {found}")
        }
        _ => format!("{plain}: the wrong protocol, the wrong baud rate, or noise"),
    }
}

/// The same for a capture that says its protocols; `named` is on the command line instead.
fn no_frame_with_times(named: Option<Protocol>, received: u64) -> String {
    match named.map(|protocol| protocol.name()) {
        Some(name) => {
            format!(
                "no frame in {received} bytes as {name}: without --protocol, the capture says it"
            )
        }
        None => format!("no frame in {received} bytes: use --protocol if it is another one"),
    }
}

/// Finds out the protocol of raw bytes, and says how sure it is.
fn detected(args: &Args, choice: Choice, input: &mut Input) -> Result<Protocol, Failure> {
    let guess = guess(choice, input)?;
    let told = match (args.json, guess.len) {
        (_, 0) => Ok(()),
        (true, _) => writeln!(io::stdout(), "{}", guess.json()),
        (false, _) => writeln!(io::stdout(), "{guess}\n"),
    };
    told.map_err(Failure::Write)?;
    Ok(guess.protocol())
}

/// Finds out the protocol of raw bytes.
fn guess(choice: Choice, input: &mut Input) -> Result<Guess, Failure> {
    let sample = input.peek(detect::SAMPLE_LEN, |sample| {
        detect::is_sure(&detect::shares(sample), sample.len())
    })?;
    let guess = Guess { shares: detect::shares(sample), len: sample.len() };
    let [best, ..] = guess.shares;
    if best.framed == 0 && guess.len > 0 {
        let line = format!("no frame of any protocol in the first {} bytes", guess.len);
        let hint =
            if guess.len < detect::SAMPLE_LEN { "" } else { ": use --protocol to decode them all" };
        return Err(Failure::Failed(line + hint));
    }
    choice.permits(best.protocol)?;
    Ok(guess)
}

/// The form of the lines; `None` for the summary alone.
fn style(args: &Args, protocol: Protocol, has_times: bool) -> Option<Style> {
    let time = if has_times { args.time } else { TimeColumn::None };
    match (args.summary, args.json) {
        (true, _) => None,
        (false, true) => Some(Style::Json),
        (false, false) => Some(Style::text(protocol.number(), time)),
    }
}

fn decode<F>(args: &Args, protocol: Protocol, input: &mut Input) -> Result<Counters, Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let style = style(args, protocol, false);
    let mut printer = Printer::new(args.json, style);
    let cores = || thread::available_parallelism().map_or(1, |cores| cores.get());
    let jobs = args.jobs.map_or_else(cores, usize::from).min(MOST_JOBS);
    let (mut sheet, mut account, mut stream) =
        (Sheet::new(style), Counters::default(), StreamOf::<F>::new(0));
    let mut broken = None;
    // A stream may be slow, and its lines are wanted as they come.
    match (input.file(), style) {
        (Some((file, len)), None) if jobs > 1 => {
            if let Some(account) = account::of_file::<F>(file, len, jobs) {
                printer.finish(&account, 0)?;
                return Ok(account);
            }
        }
        (Some(_), Some(style)) if jobs > 1 => {
            let rest = parallel::list::<F>(input, style, jobs, |lines| printer.print(lines))?;
            stream = StreamOf::new(rest.offset);
            (sheet.modes, account, broken) = (rest.modes, rest.account, rest.failure);
            stream.feed(&rest.bytes, None, &mut sheet);
        }
        _ => {}
    }
    while broken.is_none() {
        match input.read() {
            Ok([]) => break,
            Ok(bytes) => {
                // The source is slower than the tool: the listing may be watched live.
                let waiting = bytes.len() < input::CHUNK_LEN;
                stream.feed(bytes, None, &mut sheet);
                printer.print_sheet(&mut sheet)?;
                if waiting {
                    printer.flush()?;
                }
            }
            Err(failure) => broken = Some(failure),
        }
    }
    if let Some(failure) = broken {
        printer.print_sheet(&mut sheet)?;
        account += stream.counters();
        printer.break_off(&account, 0)?;
        return Err(failure);
    }
    stream.finish(&mut sheet);
    printer.print_sheet(&mut sheet)?;
    account += stream.counters();
    printer.finish(&account, 0)?;
    Ok(account)
}
