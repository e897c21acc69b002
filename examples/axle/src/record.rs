//! `axle record`: writes the traffic of a line, with times, to a pcapng file.

use std::{
    collections::VecDeque,
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf, is_separator},
    time::{Duration, Instant},
};

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Decoder, Event, Framing},
    ucp,
};

use crate::{
    args::{self, Protocol},
    clock,
    decode::BUFFER_LEN,
    failure::Failure,
    help::EXIT_CODES,
    line::{Line, PATIENCE, QUIET},
    listing::{self, Shown},
    pcapng::{Direction, Recording, Rotation},
    signals::Signals,
};

/// Record the traffic of a line, with times, without sending anything
///
/// Writes pcapng, which `axle decode` and Wireshark read: one packet per frame, and one or more per
/// run of bytes between frames, each with the time of its last byte in microseconds. The times are
/// those at which this program got the bytes from the system; behind a USB adapter, that can be
/// 16 ms after they were on the line. Name of the port, protocol and speed are in the file.
///
/// Ends after --for, on Ctrl-C, and when the port fails; what was recorded by then is complete. A
/// power cut costs at most the last second. With less than 16 MB left on the disk, or a twentieth
/// of a small one, the recording ends; on a full one the file ends with the last whole packet.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// The serial port, such as /dev/ttyUSB0 or COM3; or tcp:HOST:PORT
    #[arg(short, long, value_name = "PATH")]
    port: String,

    /// Line speed, bit/s; by default 500000 for Ikeya and 115200 for UCP
    #[arg(short, long, value_parser = clap::value_parser!(u32).range(1..))]
    baud: Option<u32>,

    /// Protocol of the line
    #[arg(short = 'P', long, value_enum)]
    protocol: Protocol,

    /// Duration, seconds; by default, until Ctrl-C
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    micros: Option<u64>,

    /// The file; - is standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Go on in another file before one has more than this, as in 100MB, or has packets of a
    /// longer time, as in 1h. Each has its number and time (UTC) in its name: bus.pcapng becomes
    /// bus_00001_20261231235959.pcapng, which Wireshark lists as a set
    #[arg(long, value_name = "SIZE|TIME")]
    rotate: Option<Rotation>,

    /// Overwrite the file if there is one
    #[arg(long)]
    force: bool,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let baud = args.baud.unwrap_or(args.protocol.default_baud());
    let is_piped = args.output == Path::new("-");
    let line = Line::connect(&args.port, baud)?;
    let file = match args.rotate {
        Some(_) if !is_name_of_files(&args.output) => {
            let output = &args.output;
            let line = format!("--rotate writes several files: {output:?} is no name for them");
            return Err(Failure::Usage(line));
        }
        Some(rotation) => {
            let of = (args.protocol, line.path(), baud);
            Recording::create_first(&args.output, args.force, rotation, of)?
        }
        None => Recording::create(&args.output, args.force, args.protocol, line.path(), baud)?,
    };
    if args.micros.is_none() && io::stderr().is_terminal() {
        eprintln!("axle: recording {:?} until Ctrl-C", args.port);
    }
    let end = args.micros.map(|micros| clock::now() + Duration::from_micros(micros));
    let Recorded { account, file, outcome } = record_line(line, file, end, &signals);
    if !is_piped {
        let mut out = io::stdout().lock();
        let told = listing::print_summary(&mut out, &account, false);
        told.and_then(|()| match file.files() {
            Some(1) => writeln!(out, "{:>10} file, {:?}", 1, file.path()),
            Some(count) => writeln!(out, "{count:>10} files, the last is {:?}", file.path()),
            None => Ok(()),
        })
        .and_then(|()| out.flush())
        .map_err(Failure::Write)?;
    }
    outcome
}

/// Whether files can be named after it: it is no folder, no device and not standard output.
fn is_name_of_files(path: &Path) -> bool {
    let last = path.as_os_str().as_encoded_bytes().last();
    let is_folder = last.is_none_or(|last| is_separator(*last as char));
    path != Path::new("-") && !is_folder && (path.is_file() || !path.exists())
}

/// What has become of a recording.
pub(crate) struct Recorded {
    account: Counters,
    pub(crate) file: Recording,
    pub(crate) outcome: Result<(), Failure>,
}

/// Records a line until `end`, a signal, or a failure of the file or the port.
pub(crate) fn record_line(
    line: Line,
    file: Recording,
    end: Option<Instant>,
    signals: &Signals,
) -> Recorded {
    match file.protocol() {
        Protocol::Ucp => record_frames::<ucp::Ucp>(line, file, end, signals),
        Protocol::Ikeya => record_frames::<ikeya::BothDirections>(line, file, end, signals),
        Protocol::Ikeya3 => record_frames::<three::BothDirections>(line, file, end, signals),
    }
}

fn record_frames<F>(
    mut line: Line,
    file: Recording,
    end: Option<Instant>,
    signals: &Signals,
) -> Recorded
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let mut frames = Frames::<F>::new(file);
    let mut buffer = [0; 4096];
    let mut recorded = Ok(());
    let broken = loop {
        let now = clock::now();
        if recorded.is_err() || signals.is_raised() || end.is_some_and(|end| now >= end) {
            break Ok(());
        }
        let patience = end.map_or(PATIENCE, |end| PATIENCE.min(end - now));
        match line.receive(&mut buffer, patience) {
            Ok(bytes) => recorded = frames.take(bytes),
            Err(failure) => break Err(failure),
        }
    };
    let recorded = recorded.and_then(|()| frames.finish());
    Recorded { account: frames.account(), file: frames.file, outcome: recorded.and(broken) }
}

/// Cuts what is received into frames and the bytes between them, a packet each.
pub(crate) struct Frames<F> {
    file: Recording,
    decoder: Decoder<F, BUFFER_LEN>,
    /// Bytes received and not written yet, and the end and the time of each chunk of them.
    unwritten: VecDeque<u8>,
    chunks: VecDeque<(u64, u64)>,
    /// Number of bytes written so far.
    written: u64,
    heard_at: Instant,
}

impl<F> Frames<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    pub(crate) fn new(file: Recording) -> Self {
        Self {
            file,
            decoder: Decoder::new(),
            unwritten: VecDeque::new(),
            chunks: VecDeque::new(),
            written: 0,
            heard_at: clock::now(),
        }
    }

    /// Takes in what has just been received, possibly nothing, and writes all that is decided.
    pub(crate) fn take(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.take_at(bytes, self.file.micros())
    }

    /// The same, with the time: microseconds since 1970, never less than before.
    pub(crate) fn take_at(&mut self, bytes: &[u8], micros: u64) -> Result<(), Failure> {
        if bytes.is_empty() {
            if clock::since(self.heard_at).as_micros() >= QUIET.as_micros().into()
                && self.decoder.pending() > 0
            {
                self.decoder.idle();
                return self.write(&[]);
            }
            self.file.check_reader();
            return self.file.check();
        }
        self.heard_at = clock::now();
        let end = self.decoder.received() + bytes.len() as u64;
        self.chunks.push_back((end, micros));
        self.unwritten.extend(bytes);
        self.write(bytes)
    }

    /// Writes each frame that `bytes` complete, and the bytes between frames as soon as they are
    /// decided.
    fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let (mut input, mut frames) = (bytes, Vec::new());
        let mut next = self.written;
        while let Some(event) = self.decoder.decode(&mut input) {
            if let Event::Frame(frame) = event {
                let len = frame.bytes().len() as u64;
                frames.push((next, len));
                next += len;
                continue;
            }
            // Part of the gap may have been written already.
            let decided = self.decoder.counters();
            next = decided.framed + decided.skipped();
        }
        for (at, len) in frames {
            self.packet(at - self.written);
            self.packet(len);
        }
        let decided = self.decoder.received() - self.decoder.pending() as u64;
        self.packet(decided - self.written);
        self.file.flush();
        self.file.check()
    }

    /// Writes the next `len` bytes, with the time of the last.
    fn packet(&mut self, len: u64) {
        if len == 0 {
            return;
        }
        self.written += len;
        while self.chunks.front().is_some_and(|(end, _)| *end < self.written) {
            self.chunks.pop_front();
        }
        let micros = self.chunks.front().map_or(0, |(_, micros)| *micros);
        let bytes: Vec<u8> = self.unwritten.drain(..len as usize).collect();
        self.file.packet(micros, Some(Direction::In), &bytes);
    }

    /// The account of what was received.
    pub(crate) fn account(&self) -> Counters {
        self.decoder.counters()
    }

    /// Writes what is left.
    pub(crate) fn finish(&mut self) -> Result<(), Failure> {
        loop {
            self.decoder.idle();
            self.write(&[])?;
            if self.decoder.pending() == 0 {
                return Ok(());
            }
        }
    }
}

#[cfg(all(test, unix))]
mod tests;
