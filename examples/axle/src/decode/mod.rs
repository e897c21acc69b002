//! `axle decode`: reads a capture, prints one line per frame and per gap.

mod account;
mod capture;
mod detect;
mod parallel;
mod stream;

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
    thread,
};

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Framing},
    ucp,
};
use clap::ValueEnum;

use crate::{
    EXIT_CODES,
    args::Protocol,
    failure::Failure,
    input::{self, Input},
    listing::{self, Modes, Shown, Style, TimeColumn},
    pcapng,
};
use detect::Share;
use stream::StreamOf;
pub(crate) use stream::{BUFFER_LEN, Sheet, Stream, Taken};

/// List the frames of a capture, and the gaps between them
///
/// Reads raw bytes, or pcapng as `axle record` writes it; standard input too. Every byte appears in
/// exactly one line: a frame, or a gap with the reason why no frame starts there. The end of the
/// input counts as a quiet line: a truncated frame becomes a gap. Memory use does not grow with the
/// input.
///
/// The time of a frame is that of its last byte: of the moment when the recording program got it
/// from the system, with all bytes of the same chunk. Behind a USB adapter, that can be 16 ms after
/// it was on the line. Raw bytes have no times.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Protocol of the line; auto takes that of a pcapng file, or the one with the most frames at
    /// the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    protocol: Choice,

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

    /// Threads for a file of raw bytes; by default, as many as there are cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,

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

/// What `--protocol` accepts.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
enum Choice {
    /// Find it out
    Auto,
    /// Link between the Linux board and the robot of a rover
    Ucp,
    /// Motor bus, one motor per board
    Ikeya,
    /// Motor bus, three motors per board
    #[value(name = "ikeya-3")]
    Ikeya3,
}

impl Choice {
    const fn protocol(self) -> Option<Protocol> {
        match self {
            Self::Auto => None,
            Self::Ucp => Some(Protocol::Ucp),
            Self::Ikeya => Some(Protocol::Ikeya),
            Self::Ikeya3 => Some(Protocol::Ikeya3),
        }
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let chosen = args.protocol.protocol();
    if args.direction.is_some() && chosen == Some(Protocol::Ucp) {
        let line = "--direction is for ikeya and ikeya-3: UCP frames show their own direction";
        return Err(Failure::Usage(line.to_owned()));
    }
    let mut input = Input::open(args.file.as_deref())?;
    if input.is_pcapng()? {
        return capture::run(args, input, chosen);
    }
    let protocol = match chosen {
        Some(protocol) => protocol,
        None => detected(args, &mut input)?,
    };
    let direction = if protocol == Protocol::Ucp { None } else { args.direction };
    let run = match (protocol, direction) {
        (Protocol::Ucp, _) => decode::<ucp::Ucp>,
        (Protocol::Ikeya, None) => decode::<ikeya::BothDirections>,
        (Protocol::Ikeya, Some(Direction::ToSlave)) => decode::<ikeya::ToSlave>,
        (Protocol::Ikeya, Some(Direction::ToMaster)) => decode::<ikeya::ToMaster>,
        (Protocol::Ikeya3, None) => decode::<three::BothDirections>,
        (Protocol::Ikeya3, Some(Direction::ToSlave)) => decode::<three::ToSlave>,
        (Protocol::Ikeya3, Some(Direction::ToMaster)) => decode::<three::ToMaster>,
    };
    // For a hint at the end, if there are no frames.
    input.keep_first(detect::SAMPLE_LEN);
    let account = run(args, protocol, &mut input)?;
    if account.frames == 0 && account.received > 0 {
        return Err(Failure::Failed(no_frame(protocol, &account, &detect::shares(input.first()))));
    }
    Ok(())
}

/// A stream of this protocol, in one direction of a line.
pub(crate) fn stream_of(protocol: Protocol, direction: pcapng::Direction) -> Box<dyn Stream> {
    capture::stream(protocol, None, Some(direction))
}

/// All frames of a capture, and the modes of the nodes at its end. `chosen` is needed for raw
/// bytes.
pub(crate) fn frames_of(
    path: &Path,
    chosen: Option<Protocol>,
) -> Result<(Protocol, Vec<Taken>, Modes), Failure> {
    let mut input = Input::open(Some(path))?;
    let (mut sheet, mut found) = (Sheet::new(None), chosen);
    sheet.taken = Some(Vec::new());
    if input.is_pcapng()? {
        let mut mixed = false;
        let walked = capture::walk(&mut input, chosen, &mut sheet, |protocol, _| {
            mixed |= *found.get_or_insert(protocol) != protocol;
            Ok(())
        })?;
        if let Some(problem) = walked.problem {
            return Err(problem.failure(Some(path.to_owned())));
        }
        if mixed {
            return Err(Failure::Failed(format!("{path:?} has lines of several protocols")));
        }
    } else if let Some(protocol) = chosen {
        let mut stream = capture::stream(protocol, None, None);
        loop {
            let bytes = input.read()?;
            if bytes.is_empty() {
                break;
            }
            stream.feed(bytes, None, &mut sheet);
        }
        stream.finish(&mut sheet);
    }
    let protocol = found.ok_or_else(|| {
        Failure::Usage("--protocol is needed for a capture of raw bytes".to_owned())
    })?;
    Ok((protocol, sheet.taken.take().unwrap_or_default(), sheet.modes))
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

/// Finds out the protocol of raw bytes, and says how sure it is.
fn detected(args: &Args, input: &mut Input) -> Result<Protocol, Failure> {
    let sample = input.peek(detect::SAMPLE_LEN, |sample| {
        detect::is_sure(&detect::shares(sample), sample.len())
    })?;
    let (shares, len) = (detect::shares(sample), sample.len());
    let [best, others @ ..] = &shares;
    if best.framed == 0 && len > 0 {
        let line = format!("no frame of any protocol in the first {len} bytes");
        return Err(Failure::Failed(line));
    }
    let mut out = io::stdout().lock();
    let told = match (args.json, len) {
        (_, 0) => Ok(()),
        (true, _) => {
            let found: Vec<_> = shares
                .iter()
                .map(|share| format!("\"{}\":{}", share.protocol.name(), share.framed))
                .collect();
            writeln!(
                out,
                "{{\"event\":\"protocol\",\"protocol\":\"{}\",\"received\":{len},\"framed\":{{{}}}}}",
                best.protocol.name(),
                found.join(",")
            )
        }
        (false, _) => {
            let (name, framed) = (best.protocol.name(), best.framed);
            let others =
                others.iter().map(|share| format!("{} {}", share.protocol.name(), share.framed));
            let others: Vec<_> = others.collect();
            writeln!(
                out,
                "protocol {name}: {framed} of the first {len} bytes are in its frames ({})\n",
                others.join(", ")
            )
        }
    };
    told.map_err(Failure::Write)?;
    Ok(best.protocol)
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
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let (mut sheet, mut account, mut stream) =
        (Sheet::new(style), Counters::default(), StreamOf::<F>::new(0));
    let mut broken = None;
    if let (Some((file, len)), None, 2..) = (input.file(), style, jobs)
        && let Some(account) = account::of_file::<F>(file, len, jobs)
    {
        printer.finish(&account, 0)?;
        return Ok(account);
    }
    // A stream may be slow, and its lines are wanted as they come.
    if input.file().is_some() && jobs > 1 {
        let rest = parallel::list::<F>(input, style, jobs, |lines| printer.print(lines))?;
        stream = StreamOf::new(rest.offset);
        (sheet.modes, account, broken) = (rest.modes, rest.account, rest.failure);
        stream.feed(&rest.bytes, None, &mut sheet);
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
        // What was decoded is still valid; the missing summary shows that it is incomplete.
        printer.print_sheet(&mut sheet)?;
        printer.flush()?;
        return Err(failure);
    }
    stream.finish(&mut sheet);
    printer.print_sheet(&mut sheet)?;
    account += stream.counters();
    printer.finish(&account, 0)?;
    Ok(account)
}

/// Writes lines to standard output, with the titles in front of the first and the summary behind
/// the last.
struct Printer {
    out: io::BufWriter<io::StdoutLock<'static>>,
    is_json: bool,
    style: Option<Style>,
    has_lines: bool,
}

impl Printer {
    fn new(is_json: bool, style: Option<Style>) -> Self {
        let out = io::BufWriter::with_capacity(64 * 1024, io::stdout().lock());
        Self { out, is_json, style, has_lines: false }
    }

    fn print(&mut self, lines: &[u8]) -> Result<(), Failure> {
        if lines.is_empty() {
            return Ok(());
        }
        if !self.has_lines {
            self.has_lines = true;
            let mut titles = listing::Out::default();
            if let Some(style) = &self.style {
                style.titles(&mut titles);
            }
            self.out.write_all(&titles.0).map_err(Failure::Write)?;
        }
        self.out.write_all(lines).map_err(Failure::Write)
    }

    /// Prints the lines of a sheet, and empties it.
    fn print_sheet(&mut self, sheet: &mut Sheet) -> Result<(), Failure> {
        self.print(&sheet.out.0)?;
        sheet.out.0.clear();
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Failure> {
        self.out.flush().map_err(Failure::Write)
    }

    fn finish(mut self, account: &Counters, times_back: u64) -> Result<(), Failure> {
        let printed = if self.is_json {
            let mut line = listing::Out::default();
            listing::json_summary(&mut line, account, 0, times_back);
            self.out.write_all(&line.0)
        } else {
            listing::print_summary(&mut self.out, account, 0, self.has_lines).and_then(|()| {
                match times_back {
                    0 => Ok(()),
                    times => writeln!(self.out, "{times:>10} times the clock went backwards"),
                }
            })
        };
        printed.map_err(Failure::Write)?;
        self.flush()
    }
}
