//! `axle decode`: reads a capture, prints one line per frame and per gap.

mod account;
mod args;
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
    path::PathBuf,
    thread,
};

use axlewire::stream::{Counters, Framing};

use crate::{
    args::Protocol,
    captures,
    failure::Failure,
    input::{self, Form, Input},
    listing::{Place, Shown},
    pcapng,
};
use args::style;
pub(crate) use args::{Args, Direction, Named};
pub(crate) use detect::shares;
use detect::{guess, no_frame};
pub(crate) use framing::Choice;
use framing::for_framing;
use printer::Printer;
use stream::StreamOf;
pub(crate) use stream::{BUFFER_LEN, Sheet, Stream, Taken};
pub(crate) use walk::{Next, SHORT_STEP_US, Walked, walk};
pub(crate) use whole::{Chosen, choose, walk_into};

/// Maximum number of threads: each has its own buffers, and the more there are, the shorter
/// are the parts of the file.
const MOST_JOBS: usize = 16;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let choice =
        Choice { protocol: args.protocol.0, direction: args.direction, ..Choice::default() };
    if let Some(protocol) = choice.protocol {
        choice.permits(protocol)?;
    }
    let mut input = captures::open(&args.files, args.form)?;
    if input.has_times()? {
        return capture::run(args, input, choice);
    }
    let protocol = match choice.protocol {
        Some(protocol) => protocol,
        None => detected(args, choice, &mut input)?,
    };
    // For the hint at the end, if there are no frames.
    input.keep_first(detect::SAMPLE_LEN);
    let run = for_framing!(decode, protocol, choice.direction);
    let account = run(args, protocol, &mut input)?;
    if account.frames == 0 && account.received > 0 {
        return Err(Failure::Failed(no_frame(protocol, &account, &shares(input.first()))));
    }
    Ok(())
}

/// A stream of this protocol, in one direction of a line.
pub(crate) fn stream_of(protocol: Protocol, direction: pcapng::Direction) -> Box<dyn Stream> {
    Choice::default().stream(protocol, None, Some(direction))
}

/// Lists a frame that was at this place.
pub(crate) fn list_again(protocol: Protocol, at: Place, frame: &[u8], sheet: &mut Sheet) {
    let mut stream = Choice::default().stream_at(protocol, at);
    stream.feed(frame, at.micros, sheet);
    stream.finish(sheet);
}

/// All frames of a capture of one line, as far as it can be read, and the modes of its nodes.
/// `chosen` is needed for raw bytes.
///
/// The frames are for one line again. So there may be no other in the capture, and no doubt about
/// how a command was meant: its node must not have changed its mode (ruling I3).
pub(crate) fn frames_of(
    paths: &[PathBuf],
    form: Form,
    chosen: Option<Protocol>,
    interface: Option<usize>,
) -> Result<(Protocol, Vec<Taken>, Walked), Failure> {
    let mut input = captures::open(paths, form)?;
    let mut sheet = Sheet::new(None);
    sheet.taken = Some(Default::default());
    let choice = Choice { protocol: chosen, interface, joins_sections: true, ..Choice::default() };
    let mut found = None;
    let mut walked = walk(&mut input, choice, &mut sheet, |next, _| {
        let line = (next.protocol, next.interface);
        if *found.get_or_insert(line) != line {
            return Err(Failure::Failed(format!(
                "{} has more than one line: choose one with --interface",
                captures::named(paths)
            )));
        }
        Ok(true)
    });
    if let Some(failure) = walked.broken.take().or_else(|| walked.cut.take_if(|_| found.is_none()))
    {
        return Err(failure);
    }
    let protocol = found.map(|(protocol, _)| protocol).or(chosen);
    let protocol = protocol.ok_or_else(|| Failure::Failed(nothing(paths, interface)))?;
    let (taken, turned) = sheet.taken.unwrap_or_default();
    let mut commanded = taken.iter().filter_map(|taken| taken.commands);
    if let Some(node) = commanded.find(|node| turned.contains(node)) {
        let paths = captures::named(paths);
        let line = format!("node {node} changes its mode in {paths}: its commands are ambiguous");
        return Err(Failure::Failed(line));
    }
    Ok((protocol, taken, walked))
}

/// Nothing was read of these captures.
pub(crate) fn nothing(paths: &[PathBuf], interface: Option<usize>) -> String {
    let named = captures::named(paths);
    match interface {
        Some(interface) => format!("{named} has nothing on interface {interface}"),
        None => format!("{named} has no bytes"),
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
    // A stream may be slow: print its lines as they come.
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
