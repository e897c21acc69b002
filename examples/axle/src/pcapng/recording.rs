//! A capture that grows in a file, or in one file after another.

use std::{
    fs::File,
    io::{self, IsTerminal, Write},
    mem,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use super::{
    Direction, Writer,
    keeper::Keeper,
    write::{packet_len, whole_blocks},
};
use crate::{args::Protocol, clock, failure::Failure};

/// A capture in a file or on standard output, and the clock of its times.
pub(crate) struct Recording {
    /// What is not written yet.
    writer: Writer,
    output: Output,
    keeper: Option<Keeper>,
    path: PathBuf,
    line: (Protocol, String, u32),
    /// Bytes and packets that are written.
    len: u64,
    packets: u64,
    files: Option<Files>,
    stamp: Stamp,
    /// The first failure. Nothing is written behind it.
    failure: Option<Failure>,
}

/// The files of a recording that goes on in another one from time to time.
struct Files {
    /// The name of each, but for its number and time.
    path: PathBuf,
    force: bool,
    rotation: Rotation,
    count: u32,
    /// When the latest was begun, microseconds since 1970.
    begun: u64,
}

/// When a recording goes on in another file: before one has more than this.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Rotation {
    Bytes(u64),
    Micros(u64),
}

/// The time on a clock that never goes backwards: the system's may be set while we record.
#[derive(Clone, Copy)]
pub(crate) struct Stamp {
    start: Instant,
    /// The same moment on the system's clock.
    is_then: SystemTime,
}

impl Stamp {
    pub(crate) fn new() -> Self {
        Self { start: clock::now(), is_then: SystemTime::now() }
    }

    /// Microseconds since 1970.
    pub(crate) fn micros(self) -> u64 {
        let time = self.is_then + clock::since(self.start);
        time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_micros() as u64)
    }
}

/// A file, a pipe with a reader, or memory.
enum Output {
    File(File),
    /// A named pipe.
    Pipe(File),
    Stdout(io::Stdout),
    Memory(Vec<u8>),
}

/// What a recording in memory may have, bytes.
pub(crate) const MOST_IN_MEMORY: usize = 128 << 20;

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) | Self::Pipe(file) => file.write(bytes),
            Self::Stdout(stdout) => stdout.write(bytes),
            Self::Memory(memory) if memory.len() + bytes.len() > MOST_IN_MEMORY => {
                Err(io::Error::other("128 MB is the most that memory holds"))
            }
            Self::Memory(memory) => memory.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) | Self::Pipe(file) => file.flush(),
            Self::Stdout(stdout) => stdout.flush(),
            Self::Memory(_) => Ok(()),
        }
    }
}

impl Recording {
    /// Creates the file, and does not overwrite one unless `force` is set; `-` is standard output.
    pub(crate) fn create(
        path: &Path,
        force: bool,
        protocol: Protocol,
        port: &str,
        baud: u32,
    ) -> Result<Self, Failure> {
        let output = if path == Path::new("-") {
            if io::stdout().is_terminal() {
                let line = "a recording is not text: name a file, or pipe it";
                return Err(Failure::Usage(line.to_owned()));
            }
            Output::Stdout(io::stdout())
        } else {
            Output::File(create(path, force)?)
        };
        Self::begin(output, path, protocol, port, baud)
            .map_err(|error| Failure::cannot_create(path, &error))
    }

    /// Creates the first of several files. Each has its number and time in its name, as those of
    /// dumpcap: Wireshark lists such files as a set.
    pub(crate) fn create_first(
        path: &Path,
        force: bool,
        rotation: Rotation,
        (protocol, port, baud): (Protocol, &str, u32),
    ) -> Result<Self, Failure> {
        let mut files = Files {
            path: path.to_owned(),
            force,
            rotation,
            count: 0,
            begun: Stamp::new().micros(),
        };
        let first = files.next_path(files.begun);
        let recording = Self::create(&first, force, protocol, port, baud)?;
        Ok(Self { files: Some(files), ..recording })
    }

    /// Writes to a named pipe that is there, once it has a reader. It is no failure if the reader
    /// closes it.
    pub(crate) fn to_pipe(
        path: &Path,
        protocol: Protocol,
        port: &str,
        baud: u32,
    ) -> Result<Self, Failure> {
        let opened = File::options().write(true).open(path);
        let pipe = opened.map_err(|error| Failure::Open { path: path.to_owned(), error })?;
        Self::begin(Output::Pipe(pipe), path, protocol, port, baud).map_err(Failure::Write)
    }

    /// Writes to memory.
    pub(crate) fn to_memory(protocol: Protocol, port: &str, baud: u32) -> Result<Self, Failure> {
        let memory = Output::Memory(Vec::new());
        Self::begin(memory, Path::new("memory"), protocol, port, baud).map_err(Failure::Write)
    }

    /// What is in memory.
    pub(crate) fn into_memory(self) -> Vec<u8> {
        if let Output::Memory(memory) = self.output { memory } else { Vec::new() }
    }

    fn begin(
        output: Output,
        path: &Path,
        protocol: Protocol,
        port: &str,
        baud: u32,
    ) -> io::Result<Self> {
        let keeper = match &output {
            Output::File(file) => Keeper::new(file, path)?,
            Output::Pipe(_) | Output::Stdout(_) | Output::Memory(_) => None,
        };
        let mut recording = Self {
            writer: Writer::new(protocol, port, baud),
            output,
            keeper,
            path: path.to_owned(),
            line: (protocol, port.to_owned(), baud),
            len: 0,
            packets: 0,
            files: None,
            stamp: Stamp::new(),
            failure: None,
        };
        recording.write()?;
        Ok(recording)
    }

    /// A recording to an open file.
    #[cfg(all(test, unix))]
    pub(super) fn to_file(file: File) -> Self {
        Self::begin(Output::File(file), Path::new("file"), Protocol::Ucp, "port", 1).unwrap()
    }

    /// The protocol of its line.
    pub(crate) const fn protocol(&self) -> Protocol {
        self.line.0
    }

    /// The file that is written now.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// How many files there are, if there may be several.
    pub(crate) fn files(&self) -> Option<u32> {
        self.files.as_ref().map(|files| files.count)
    }

    pub(super) const fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// What follows is of another line.
    pub(crate) fn change_line(&mut self, protocol: Protocol, port: &str, baud: u32) {
        self.line = (protocol, port.to_owned(), baud);
        self.writer.interface(protocol, port, baud);
    }

    /// The time, microseconds since 1970. It never goes backwards.
    pub(crate) fn micros(&self) -> u64 {
        self.stamp.micros()
    }

    /// Adds a packet of this time, which the next [`flush`](Self::flush) writes.
    pub(crate) fn packet(&mut self, micros: u64, direction: Option<Direction>, bytes: &[u8]) {
        if self.files.as_ref().is_some_and(|files| {
            let len = self.len + self.writer.blocks.len() as u64 + packet_len(bytes);
            files.is_over(len, micros)
        }) {
            self.flush();
            self.change_file(micros);
        }
        if self.failure.is_none() {
            self.writer.packet(micros, direction, bytes);
        }
    }

    /// Writes all that was added.
    pub(crate) fn flush(&mut self) {
        if self.failure.is_none() {
            self.write().unwrap_or_else(|error| self.fail(error));
        }
    }

    /// Of blocks that do not fit, the whole ones stay: a part would make the file invalid.
    fn write(&mut self) -> io::Result<()> {
        let mut blocks = mem::take(&mut self.writer.blocks);
        let (count, written) = write_most(&mut self.output, &blocks);
        let (len, packets) = whole_blocks(blocks.get(..count).unwrap_or_default());
        self.len += len as u64;
        self.packets += packets;
        if let Some(keeper) = &self.keeper {
            keeper.has_news();
        }
        if let (Err(_), Output::File(file)) = (&written, &self.output) {
            // A full disk permits this.
            let _ = file.set_len(self.len);
        }
        blocks.clear();
        self.writer.blocks = blocks;
        written
    }

    /// Goes on in the next file.
    fn change_file(&mut self, micros: u64) {
        if self.failure.is_some() {
            return;
        }
        let Some(mut files) = self.files.take() else { return };
        let (protocol, port, baud) = &self.line;
        let next = Self::create(&files.next_path(micros), files.force, *protocol, port, *baud);
        match next {
            Ok(next) => *self = Self { files: Some(files), stamp: self.stamp, ..next },
            Err(failure) => {
                files.count -= 1;
                (self.files, self.failure) = (Some(files), Some(failure));
            }
        }
    }

    /// Notices that the reader of a named pipe is gone while there is nothing to write.
    pub(crate) fn check_reader(&mut self) {
        if matches!(self.output, Output::Pipe(_)) && has_no_reader(&self.path) {
            self.fail(io::ErrorKind::BrokenPipe.into());
        }
    }

    /// The failure, if there was one.
    pub(crate) fn check(&mut self) -> Result<(), Failure> {
        if self.failure.is_none() {
            self.failure = self.keeper.as_ref().and_then(Keeper::failure);
        }
        self.failure.take().map_or(Ok(()), Err)
    }

    fn fail(&mut self, error: io::Error) {
        let (path, packets) = (&self.path, self.packets);
        let failure = match self.output {
            Output::File(_) => Failure::Failed(format!(
                "cannot write {path:?}: {error}; the {packets} packets in it are complete"
            )),
            Output::Pipe(_) | Output::Stdout(_) | Output::Memory(_) => Failure::Write(error),
        };
        self.failure.get_or_insert(failure);
    }
}

impl Files {
    /// Whether a file of this length and with this time would be too much.
    const fn is_over(&self, len: u64, micros: u64) -> bool {
        match self.rotation {
            Rotation::Bytes(limit) => len > limit,
            Rotation::Micros(limit) => micros >= self.begun.saturating_add(limit),
        }
    }

    /// The next path, such as `bus_00001_20261127093207.pcapng` for `bus.pcapng`.
    fn next_path(&mut self, micros: u64) -> PathBuf {
        (self.count, self.begun) = (self.count + 1, micros);
        let second = humantime::format_rfc3339_seconds(UNIX_EPOCH + Duration::from_micros(micros));
        let digits: String = second.to_string().chars().filter(char::is_ascii_digit).collect();
        let mut name = self.path.file_stem().unwrap_or_default().to_owned();
        name.push(format!("_{:05}_{digits}", self.count));
        if let Some(extension) = self.path.extension() {
            name.push(".");
            name.push(extension);
        }
        self.path.with_file_name(name)
    }
}

impl core::str::FromStr for Rotation {
    type Err = String;

    /// Such as `100MB`, or `1h`.
    fn from_str(text: &str) -> Result<Self, String> {
        const LEAST: &str = "at least 10kB or 1s";
        let (number, factor) = match text.strip_suffix('B') {
            // humantime's M is a month.
            None if text.ends_with('M') => {
                return Err(format!(
                    "write {text}B for a size, or {}min",
                    text.trim_end_matches('M')
                ));
            }
            None => {
                let time = humantime::parse_duration(text)
                    .map_err(|_| "expected a size or a time, such as 100MB or 1h".to_owned())?;
                let micros = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
                return if micros < 1_000_000 {
                    Err(LEAST.to_owned())
                } else {
                    Ok(Self::Micros(micros))
                };
            }
            Some(size) => match size.char_indices().last() {
                Some((at, 'k')) => (&size[..at], 1e3),
                Some((at, 'M')) => (&size[..at], 1e6),
                Some((at, 'G')) => (&size[..at], 1e9),
                _ => (size, 1.0),
            },
        };
        let bytes =
            number.trim().parse::<f64>().map_err(|_| "expected a size such as 100MB")? * factor;
        if bytes >= 1e4 { Ok(Self::Bytes(bytes as u64)) } else { Err(LEAST.to_owned()) }
    }
}

/// Creates a file, and does not overwrite one unless `force` is set.
fn create(path: &Path, force: bool) -> Result<File, Failure> {
    let mut options = File::options();
    options.write(true);
    let options = match force {
        true => options.create(true).truncate(true),
        false => options.create_new(true),
    };
    options.open(path).map_err(|error| Failure::cannot_create(path, &error))
}

/// Writes, and counts the bytes that were written before a failure.
fn write_most(output: &mut Output, bytes: &[u8]) -> (usize, io::Result<()>) {
    let mut count = 0;
    loop {
        let rest = bytes.get(count..).unwrap_or_default();
        if rest.is_empty() {
            return (count, output.flush());
        }
        match output.write(rest) {
            Ok(0) => return (count, Err(io::ErrorKind::WriteZero.into())),
            Ok(more) => count += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return (count, Err(error)),
        }
    }
}

/// Whether a named pipe has no reader: then it cannot be opened again without waiting.
/// Only where the flag for that is known; elsewhere, the next write notices.
#[cfg(any(
    all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")),
    target_os = "macos",
))]
fn has_no_reader(path: &Path) -> bool {
    use std::os::unix::fs::OpenOptionsExt;

    const O_NONBLOCK: i32 = if cfg!(target_os = "macos") { 0x4 } else { 0o4000 };
    /// No such device or address.
    const ENXIO: i32 = 6;
    let opened = File::options().write(true).custom_flags(O_NONBLOCK).open(path);
    // Wireshark removes the pipe when it ends.
    opened.is_err_and(|error| {
        error.raw_os_error() == Some(ENXIO) || error.kind() == io::ErrorKind::NotFound
    })
}

#[cfg(not(any(
    all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")),
    target_os = "macos",
)))]
fn has_no_reader(_: &Path) -> bool {
    false
}
