//! `axle record`: writes the traffic of a line, with times, to a pcapng file.

use std::{
    collections::VecDeque,
    fs::File,
    io::{self, IsTerminal, Seek, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use axlewire::{
    ikeya::{self, three},
    stream::{Counters, Decoder, Event, Framing},
    ucp,
};

use crate::{
    EXIT_CODES,
    args::{self, Protocol},
    failure::Failure,
    line::Line,
    listing::{self, Shown},
    pcapng::{Direction, Writer},
    signals::Signals,
};

/// Record the traffic of a line, with times, without sending anything
///
/// Writes pcapng, which `axle decode` and Wireshark read: one packet per frame, and per run of
/// bytes between frames, each with the time of its last byte in microseconds. The times are those
/// at which this program got the bytes from the system; behind a USB adapter, that can be 16 ms
/// after they were on the line. Name of the port, protocol and speed are in the file.
///
/// Ends after --for, on Ctrl-C, and when the port fails; what was recorded by then is complete. If
/// the disk is full, the file ends with the last whole packet.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// Protocol of the line
    #[arg(short = 'P', long, value_enum)]
    protocol: Protocol,

    /// Duration, seconds; by default, until Ctrl-C
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    micros: Option<u64>,

    /// The file; - is standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Overwrite the file if there is one
    #[arg(long)]
    force: bool,
}

/// Longest wait for bytes, so that signals are noticed in time.
const PATIENCE: Duration = Duration::from_millis(50);

/// Silence that ends a partial frame (ruling B3): longer than the pauses of a USB adapter.
const QUIET: Duration = Duration::from_millis(30);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match args.protocol {
        Protocol::Ucp => record::<ucp::Ucp>(args, ucp::BAUD),
        Protocol::Ikeya => record::<ikeya::BothDirections>(args, ikeya::BAUD),
        Protocol::Ikeya3 => record::<three::BothDirections>(args, ikeya::BAUD),
    }
}

fn record<F>(args: &Args, default_baud: u32) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let signals = Signals::listen()?;
    let mut line = Line::open(&args.line, default_baud)?;
    let baud = args.line.baud.unwrap_or(default_baud);
    let hint = "--force to overwrite it";
    let mut recording =
        Recording::<F>::create(&args.output, args.force, args.protocol, line.path(), baud, hint)?;
    let start = Instant::now();
    let end = args.micros.map(|micros| start + Duration::from_micros(micros));
    let mut buffer = [0; 4096];
    let broken = loop {
        let now = Instant::now();
        if signals.is_raised() || end.is_some_and(|end| now >= end) {
            break Ok(());
        }
        let patience = end.map_or(PATIENCE, |end| PATIENCE.min(end - now));
        match line.receive(&mut buffer, patience) {
            Ok(bytes) => recording.take(bytes, Some(Direction::In))?,
            Err(failure) => break Err(failure),
        }
    };
    let account = recording.finish()?;
    if args.output != Path::new("-") || io::stdout().is_terminal() {
        let mut out = io::stdout().lock();
        let told = listing::print_summary(&mut out, &account, 0, false);
        told.and_then(|()| out.flush()).map_err(Failure::Write)?;
    }
    broken
}

/// A growing file, and the frames in it.
pub(crate) struct Recording<F> {
    writer: Writer<Output>,
    path: PathBuf,
    decoder: Decoder<F, { crate::decode::BUFFER_LEN }>,
    /// Bytes received and not written yet, each chunk with its time.
    unwritten: VecDeque<u8>,
    chunks: VecDeque<(u64, u64)>,
    /// Bytes written so far.
    written: u64,
    packets: u64,
    heard_at: Instant,
    /// The same moment on both clocks: the system's may be set while we record.
    start: (Instant, SystemTime),
}

/// A file or standard output.
enum Output {
    File(File),
    Stdout(io::Stdout),
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stdout(stdout) => stdout.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Stdout(stdout) => stdout.flush(),
        }
    }
}

impl<F> Recording<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    /// Begins a file. `otherwise` says what helps if there is one of that name.
    pub(crate) fn create(
        path: &Path,
        force: bool,
        protocol: Protocol,
        port: &str,
        baud: u32,
        otherwise: &str,
    ) -> Result<Self, Failure> {
        let cannot = |error: io::Error| {
            let hint = match error.kind() {
                io::ErrorKind::AlreadyExists => format!(": use {otherwise}"),
                _ => String::new(),
            };
            Failure::Failed(format!("cannot create {path:?}: {error}{hint}"))
        };
        let output = if path == Path::new("-") {
            if io::stdout().is_terminal() {
                let line = "a recording is not text: use -o FILE, or pipe it";
                return Err(Failure::Usage(line.to_owned()));
            }
            Output::Stdout(io::stdout())
        } else {
            let mut options = File::options();
            options.write(true).create(true).truncate(true).create_new(!force);
            Output::File(options.open(path).map_err(cannot)?)
        };
        let writer = Writer::new(output, protocol, port, baud).map_err(cannot)?;
        let now = Instant::now();
        Ok(Self {
            writer,
            path: path.to_owned(),
            decoder: Decoder::new(),
            unwritten: VecDeque::new(),
            chunks: VecDeque::new(),
            written: 0,
            packets: 0,
            heard_at: now,
            start: (now, SystemTime::now()),
        })
    }

    /// Takes in what has just been received, possibly nothing, and writes all that is decided.
    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        direction: Option<Direction>,
    ) -> Result<(), Failure> {
        let now = Instant::now();
        if bytes.is_empty() {
            if now >= self.heard_at + QUIET && self.decoder.pending() > 0 {
                self.decoder.idle();
                return self.write(&[], direction);
            }
            return Ok(());
        }
        self.heard_at = now;
        let time = self.start.1 + (now - self.start.0);
        let micros = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_micros() as u64);
        self.chunks.push_back((self.decoder.received() + bytes.len() as u64, micros));
        self.unwritten.extend(bytes);
        self.write(bytes, direction)
    }

    /// Writes each frame in `bytes`, and the bytes between frames as soon as they are decided.
    fn write(&mut self, bytes: &[u8], direction: Option<Direction>) -> Result<(), Failure> {
        let mut input = bytes;
        let mut frames = VecDeque::new();
        let mut next = self.written;
        while let Some(event) = self.decoder.decode(&mut input) {
            let len = match event {
                Event::Frame(frame) => {
                    let len = frame.bytes().len() as u64;
                    frames.push_back((next, len));
                    len
                }
                // Part of it may be written already.
                Event::Skipped(_) => {
                    let decided = self.decoder.counters();
                    next = decided.framed + decided.skipped();
                    continue;
                }
            };
            next += len;
        }
        while let Some((at, len)) = frames.pop_front() {
            self.packet(at - self.written, direction)?;
            self.packet(len, direction)?;
        }
        let decided = self.decoder.received() - self.decoder.pending() as u64;
        self.packet(decided - self.written, direction)?;
        self.flush()
    }

    /// Writes the next `len` bytes, with the time of the last.
    fn packet(&mut self, len: u64, direction: Option<Direction>) -> Result<(), Failure> {
        if len == 0 {
            return Ok(());
        }
        self.written += len;
        while self.chunks.front().is_some_and(|(end, _)| *end < self.written) {
            self.chunks.pop_front();
        }
        let micros = self.chunks.front().map_or(0, |(_, micros)| *micros);
        let bytes: Vec<u8> = self.unwritten.drain(..len as usize).collect();
        let good = match self.writer.get_mut() {
            Output::File(file) => file.stream_position().ok(),
            Output::Stdout(_) => None,
        };
        let result = self.writer.packet(micros, direction, &bytes);
        if result.is_err()
            && let (Output::File(file), Some(good)) = (self.writer.get_mut(), good)
        {
            // The beginning of a packet would make the file invalid. A full disk permits this.
            let _ = file.set_len(good);
        }
        result.map_err(|error| self.failure(&error))?;
        self.packets += 1;
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Failure> {
        let flushed = self.writer.get_mut().flush();
        flushed.map_err(|error| self.failure(&error))
    }

    fn failure(&self, error: &io::Error) -> Failure {
        let (path, packets) = (&self.path, self.packets);
        if path == Path::new("-") {
            return Failure::Write(io::Error::new(error.kind(), error.to_string()));
        }
        Failure::Failed(format!(
            "cannot write {path:?}: {error}; the {packets} packets in it are complete"
        ))
    }

    /// Writes what is left; returns the account.
    pub(crate) fn finish(mut self) -> Result<Counters, Failure> {
        loop {
            self.decoder.idle();
            self.write(&[], Some(Direction::In))?;
            if self.decoder.pending() == 0 {
                return Ok(self.decoder.counters());
            }
        }
    }
}
