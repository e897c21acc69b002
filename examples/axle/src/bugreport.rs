//! `axle bugreport`: what a bug report needs, in one file, after asking.

use std::{
    collections::BTreeMap,
    env::consts::{ARCH, OS},
    fmt::Write as _,
    fs::{self, File},
    io::{self, Cursor, IsTerminal, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    rc::Rc,
    time::{Duration, SystemTime},
};

use flate2::{Compression, write::GzEncoder};

use crate::{
    args::{self, Protocol},
    clock,
    decode::{Choice, Sheet, walk},
    failure::Failure,
    freely::freely,
    help::EXIT_CODES,
    input::{Form, Input},
    line::Line,
    listing,
    pcapng::{LATEST_US, MOST_IN_MEMORY, Reader, Recording, Writer, protocol_of},
    ports::{self, short_name},
    record::{Recorded, record_line},
    signals::Signals,
};

/// Collect what a bug report needs into one file, after asking
///
/// The file has the version of the tool, the system, its serial ports, and, with --port or
/// --capture, the byte counts and the last minute of a line. It is pcapng packed with gzip, for
/// `axle decode` and Wireshark; the rest is a text in it, which --show prints. You see that text
/// before the file is written. Nothing is sent, neither to the line nor to anybody.
///
/// Not in it: environment variables, the names of this machine and of its user, folders, and the
/// serial numbers of USB adapters. The name of a port ends in front of its first character that is
/// neither a letter nor a digit. The bytes of the line are as they were.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Listen to this line: a serial port, such as /dev/ttyUSB0 or COM3; or tcp:HOST:PORT. Ctrl-C
    /// ends the listening early
    #[arg(short, long, value_name = "PATH", conflicts_with = "capture", requires = "protocol")]
    port: Option<String>,

    /// Line speed, bit/s; by default 500000 for Ikeya and 115200 for UCP
    #[arg(short, long, value_parser = clap::value_parser!(u32).range(1..), requires = "port")]
    baud: Option<u32>,

    /// Protocol of the line; a capture has its own
    #[arg(short = 'P', long, value_enum)]
    protocol: Option<Protocol>,

    /// How long to listen, or how much of the end of the capture to take, seconds
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "60")]
    #[arg(value_parser = args::seconds)]
    micros: u64,

    /// Take the end of this capture, a pcapng or pcap file, and the byte counts of all of it
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,

    /// The file; by default axle-bugreport-DATE-TIME.pcapng.gz. It never replaces one
    #[arg(short, long, value_name = "FILE", value_parser = args::recording())]
    output: Option<PathBuf>,

    /// Write without asking
    #[arg(long)]
    yes: bool,

    /// Print the text of such a file
    #[arg(long, value_name = "FILE", exclusive = true)]
    show: Option<PathBuf>,
}

/// Longest text, bytes: it is one option of a block.
const LONGEST_TEXT: usize = 60_000;

/// A time that is so much earlier than the one in front of it was told by a clock that was set
/// back, µs.
const CLOCK_SET_BACK: u64 = 1_000_000;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(file) = &args.show {
        return show(file);
    }
    let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let name = || now.replace(['-', ':', 'Z'], "").replace('T', "-");
    let named = || format!("axle-bugreport-{}.pcapng.gz", name()).into();
    let path = args.output.clone().unwrap_or_else(named);
    if !path.as_os_str().as_encoded_bytes().ends_with(b".gz") {
        return Err(Failure::Usage("it is packed: let its name end in .pcapng.gz".to_owned()));
    }
    // What cannot be created is told now, and not behind a minute of listening.
    File::create_new(&path)
        .and_then(|_| fs::remove_file(&path))
        .map_err(|error| Failure::cannot_create(&path, &error))?;
    if !(args.yes || io::stdin().is_terminal() && io::stderr().is_terminal()) {
        let line = "there is no terminal to ask on: with --yes, the file is written without asking";
        return Err(Failure::Usage(line.to_owned()));
    }
    let (mut text, mut end, mut outcome) =
        (this_machine(&now), <(Writer, usize)>::default(), Ok(()));
    if let (Some(port), Some(protocol)) = (&args.port, args.protocol) {
        let Recorded { file, outcome: heard, .. } = listen(args, port, protocol, &mut text)?;
        let bytes: Rc<[u8]> = file.into_memory().into();
        let again = || Input::of(Box::new(Cursor::new(Rc::clone(&bytes))));
        (end, outcome) = (sum_up(args, again, &mut text)?, heard);
        if end.1 == 0 {
            text.push_str("Nothing was heard. Is it the right port, and does a device send?\n");
        }
    } else if let Some(file) = &args.capture {
        if !file.is_file() {
            return Err(Failure::Failed(format!("{file:?} is not a file")));
        }
        text.push_str("\nA capture:\n");
        end = sum_up(args, || Input::open_one(Some(file), Form::default()), &mut text)?;
    }
    while text.len() > LONGEST_TEXT {
        text.pop();
    }
    if !freely(|| is_wanted(args, &path, &text, end.1)).map_err(untold)? {
        return Err(Failure::Failed("nothing was written".to_owned()));
    }
    write(&path, [Writer::with_comment(&text), end.0])?;
    outcome
}

/// The tool, the system and the ports.
fn this_machine(now: &str) -> String {
    let (version, mut text) = (env!("CARGO_PKG_VERSION"), String::new());
    let on = |is_on| if is_on { "on" } else { "off" };
    let (dashboard, plot) = (on(cfg!(feature = "dashboard")), on(cfg!(feature = "plot")));
    let (mcap, parquet) = (on(cfg!(feature = "mcap")), on(cfg!(feature = "parquet")));
    let _ = writeln!(text, "axle {version} for {OS} on {ARCH}, {now}");
    let _ = writeln!(text, "dashboard {dashboard}, plot {plot}, mcap {mcap}, parquet {parquet}");
    let _ = writeln!(text, "{}\n\nSerial ports, without serial numbers:", system());
    let listed = ports::available().map(ports::without_serial_numbers);
    for line in listed.unwrap_or_else(|failure| vec![failure.to_string()]) {
        let _ = writeln!(text, "  {line}");
    }
    text
}

/// Name and version of the system.
fn system() -> String {
    let (name, arg) = if cfg!(windows) { ("cmd", "/Cver") } else { ("uname", "-srm") };
    let said = Command::new(name).arg(arg).stdin(Stdio::null()).stderr(Stdio::null()).output();
    let said = said.map_or_else(|_| Vec::new(), |said| said.stdout);
    let release = fs::read_to_string("/etc/os-release").unwrap_or_default();
    let name = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="));
    let (said, name) = (String::from_utf8_lossy(&said), name.unwrap_or_default());
    harmless(format!("{} {}", said.trim(), name.trim_matches('"')).trim())
}

/// Listens to a line, and never sends.
fn listen(
    args: &Args,
    port: &str,
    protocol: Protocol,
    text: &mut String,
) -> Result<Recorded, Failure> {
    let (signals, time) = (Signals::listen()?, Duration::from_micros(args.micros));
    let baud = args.baud.unwrap_or(protocol.default_baud());
    let line = Line::connect(port, baud)?;
    let file = Recording::to_memory(protocol, port, baud)?;
    let listening = format!("listening for {} s; Ctrl-C ends that early", time.as_secs_f64());
    say(&format!("axle: {listening}\n")).map_err(untold)?;
    let begin = clock::now();
    let recorded = record_line(line, file, Some(begin + time), &signals);
    let (short, name) = (short_name(port), protocol.name());
    let seconds = clock::since(begin).as_secs_f64();
    let _ = writeln!(text, "\nThe line {short}, {name}, {baud} bit/s, heard for {seconds:.1} s:");
    if let Err(Failure::PortLost { cause: why, .. }) = &recorded.outcome {
        let _ = writeln!(text, "The port failed: {why}");
    } else if let Err(failure) = &recorded.outcome {
        let _ = writeln!(text, "The listening ended early: {failure}");
    }
    Ok(recorded)
}

/// Adds the statistics of a whole capture to the text. Returns the packets of its end, and how many
/// bytes of the line are in them. The capture is read twice.
fn sum_up(
    args: &Args,
    open: impl Fn() -> Result<Input, Failure>,
    text: &mut String,
) -> Result<(Writer, usize), Failure> {
    let mut input = open()?;
    input.be_quiet();
    if !input.has_times()? {
        let line = "raw bytes have no times: add the capture itself to your report";
        return Err(Failure::Usage(line.to_owned()));
    }
    let choice = Choice { protocol: args.protocol, ..Choice::default() };
    let mut last = 0;
    let walked = walk(&mut input, choice, &mut Sheet::new(None), |next, _| {
        last = next.micros.unwrap_or(last);
        Ok(true)
    });
    walked.broken.map_or(Ok(()), Err)?;
    let mut summary = Vec::new();
    listing::print_summary(&mut summary, &walked.account, false).map_err(Failure::Write)?;
    text.push_str(&String::from_utf8_lossy(&summary));
    let _ = writeln!(text, "{:>10} times the clock went backwards", walked.times_back);
    walked.notes.iter().flatten().for_each(|note| text.extend([note, "\n"]));
    let (mut input, mut writer, mut bytes) = (open()?, Writer::default(), 0);
    input.be_quiet();
    let begin = last.saturating_sub(args.micros);
    // A packet without a time belongs to the one in front of it.
    let (mut is_in, mut numbers, mut packets) = (begin == 0, BTreeMap::new(), 0);
    let mut latest = 0;
    let mut reader = Reader::new(&mut input);
    let problem = loop {
        let packet = match reader.next() {
            Ok(Some(packet)) => packet,
            Ok(None) => break None,
            Err(problem) => break Some(problem),
        };
        let micros = packet.micros.filter(|micros| *micros <= LATEST_US);
        if micros.is_some_and(|micros| micros + CLOCK_SET_BACK < latest) {
            // What came before has larger times, and is not the end.
            (writer, bytes, packets) = (Writer::default(), 0, 0);
            numbers.clear();
        }
        latest = micros.unwrap_or(latest);
        is_in = micros.map_or(is_in, |micros| micros >= begin);
        let protocol = args.protocol.or(protocol_of(packet.described.link_type));
        let Some(protocol) = protocol.filter(|_| is_in) else { continue };
        let next = numbers.len() as u32;
        let number = *numbers.entry(packet.interface).or_insert_with(|| {
            let name = packet.described.name.as_deref().map(short_name).unwrap_or_default();
            writer.interface(protocol, &name, packet.described.baud);
            next
        });
        let micros = packet.micros.unwrap_or(u64::MAX);
        writer.packet_of(number, micros, packet.direction, packet.bytes);
        (bytes, packets) = (bytes + packet.bytes.len(), packets + 1);
        if writer.blocks.len() > MOST_IN_MEMORY {
            return Err(Failure::Failed("it is more than 128 MB: try a shorter --for".to_owned()));
        }
    };
    let seconds = args.micros as f64 / 1e6;
    let _ = writeln!(text, "Of its last {seconds} s: {bytes} bytes in {packets} packets");
    if let Some(problem) = problem {
        let _ = writeln!(text, "It cannot be read to its end: {problem}");
    }
    Ok((writer, bytes))
}

/// Shows what the file will have, and asks.
fn is_wanted(args: &Args, path: &Path, text: &str, bytes: usize) -> io::Result<bool> {
    let what = format!("this text and {bytes} bytes of the line go into the file");
    say(&format!("{text}\naxle: {what}. Nothing is sent anywhere.\n"))?;
    if args.yes {
        return Ok(true);
    }
    // What was typed before the text was seen is no answer.
    #[cfg(all(unix, feature = "dashboard"))]
    let _ = rustix::termios::tcflush(io::stdin(), rustix::termios::QueueSelector::IFlush);
    say(&format!("Write it to {path:?}? [y/N] "))?;
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    Ok(["y", "yes"].contains(&answer.trim().to_lowercase().as_str()))
}

fn say(text: &str) -> io::Result<()> {
    io::stderr().write_all(text.as_bytes())
}

/// Nobody could be told what the file has.
fn untold(error: io::Error) -> Failure {
    Failure::Failed(format!("cannot ask: {error}; nothing was written"))
}

/// Writes the file whole or not at all.
fn write(path: &Path, parts: [Writer; 2]) -> Result<(), Failure> {
    let cannot_create = |error| Failure::cannot_create(path, &error);
    let mut packer = GzEncoder::new(Vec::new(), Compression::default());
    let packed = parts.iter().try_for_each(|part| packer.write_all(&part.blocks));
    let packed = packed.and_then(|()| packer.finish()).map_err(cannot_create)?;
    let mut file = File::create_new(path).map_err(cannot_create)?;
    if let Err(error) = file.write_all(&packed) {
        let _ = fs::remove_file(path);
        return Err(cannot_create(error));
    }
    writeln!(io::stdout(), "{path:?}, {} bytes", packed.len()).map_err(Failure::Write)
}

/// Prints the text of a bug report.
fn show(path: &Path) -> Result<(), Failure> {
    let mut input = Input::open_one(Some(path), Form::default())?;
    let mut reader = Reader::new(&mut input);
    // The text is in front of the first packet.
    let first = reader.next().map(drop);
    match (reader.comment(), first) {
        (Some(text), _) => write!(io::stdout(), "{}", harmless(text)).map_err(Failure::Write),
        (None, Ok(())) => Err(Failure::Failed(format!("{path:?} has no text for people"))),
        (None, Err(problem)) => Err(problem.failure(Some(path.to_owned()))),
    }
}

/// Text that anybody may have written, without control sequences.
fn harmless(text: &str) -> String {
    let clean = |c: char| if c.is_control() && c != '\n' { char::REPLACEMENT_CHARACTER } else { c };
    text.chars().map(clean).collect()
}
