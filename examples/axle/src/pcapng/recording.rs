//! A capture that grows in a file.

use std::{
    fs::File,
    io::{self, IsTerminal, Seek, Write},
    path::{Path, PathBuf},
    time::{Instant, SystemTime, UNIX_EPOCH},
};

use super::{Direction, Writer};
use crate::{args::Protocol, clock, failure::Failure};

/// A capture in a file or on standard output, and the clock of its times.
pub(crate) struct Recording {
    writer: Writer<Output>,
    path: PathBuf,
    packets: u64,
    stamp: Stamp,
    /// The first failure. Nothing is written behind it.
    failure: Option<Failure>,
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

/// A file, or a pipe with a reader.
enum Output {
    File(File),
    /// A named pipe.
    Pipe(File),
    Stdout(io::Stdout),
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) | Self::Pipe(file) => file.write(bytes),
            Self::Stdout(stdout) => stdout.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) | Self::Pipe(file) => file.flush(),
            Self::Stdout(stdout) => stdout.flush(),
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
        let cannot = |error: io::Error| {
            let hint = match error.kind() {
                io::ErrorKind::AlreadyExists => ": remove it first, or choose another name",
                _ => "",
            };
            Failure::Failed(format!("cannot create {path:?}: {error}{hint}"))
        };
        let output = if path == Path::new("-") {
            if io::stdout().is_terminal() {
                let line = "a recording is not text: name a file, or pipe it";
                return Err(Failure::Usage(line.to_owned()));
            }
            Output::Stdout(io::stdout())
        } else {
            let mut options = File::options();
            options.write(true);
            let options = match force {
                true => options.create(true).truncate(true),
                false => options.create_new(true),
            };
            Output::File(options.open(path).map_err(cannot)?)
        };
        Self::begin(output, path, protocol, port, baud).map_err(cannot)
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

    fn begin(
        output: Output,
        path: &Path,
        protocol: Protocol,
        port: &str,
        baud: u32,
    ) -> io::Result<Self> {
        let (writer, path) = (Writer::new(output, protocol, port, baud)?, path.to_owned());
        Ok(Self { writer, path, packets: 0, stamp: Stamp::new(), failure: None })
    }

    /// A recording to an open file.
    #[cfg(all(test, unix))]
    pub(super) fn to_file(file: File) -> Self {
        Self::begin(Output::File(file), Path::new("file"), Protocol::Ucp, "port", 1).unwrap()
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) const fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// What follows is of another line.
    pub(crate) fn change_line(&mut self, protocol: Protocol, port: &str, baud: u32) {
        if self.failure.is_none() {
            let written = self.writer.interface(protocol, port, baud);
            written.unwrap_or_else(|error| self.fail(error));
        }
    }

    /// The time, microseconds since 1970. It never goes backwards.
    pub(crate) fn micros(&self) -> u64 {
        self.stamp.micros()
    }

    /// Writes a packet of this time.
    pub(crate) fn packet(&mut self, micros: u64, direction: Option<Direction>, bytes: &[u8]) {
        if self.failure.is_some() {
            return;
        }
        let good = match self.writer.get_mut() {
            Output::File(file) => file.stream_position().ok(),
            Output::Pipe(_) | Output::Stdout(_) => None,
        };
        match self.writer.packet(micros, direction, bytes) {
            Ok(()) => self.packets += 1,
            Err(error) => {
                if let (Output::File(file), Some(good)) = (self.writer.get_mut(), good) {
                    // The beginning of a packet would make the file invalid. A full disk permits
                    // this.
                    let _ = file.set_len(good);
                }
                self.fail(error);
            }
        }
    }

    pub(crate) fn flush(&mut self) {
        if let Err(error) = self.writer.get_mut().flush() {
            self.fail(error);
        }
    }

    /// Notices that the reader of a named pipe is gone while there is nothing to write.
    pub(crate) fn check_reader(&mut self) {
        if matches!(self.writer.get_mut(), Output::Pipe(_)) && has_no_reader(&self.path) {
            self.fail(io::ErrorKind::BrokenPipe.into());
        }
    }

    /// The failure, if there was one.
    pub(crate) fn check(&mut self) -> Result<(), Failure> {
        self.failure.take().map_or(Ok(()), Err)
    }

    fn fail(&mut self, error: io::Error) {
        let (path, packets) = (&self.path, self.packets);
        let failure = match self.writer.get_mut() {
            Output::File(_) => Failure::Failed(format!(
                "cannot write {path:?}: {error}; the {packets} packets in it are complete"
            )),
            Output::Pipe(_) | Output::Stdout(_) => Failure::Write(error),
        };
        self.failure.get_or_insert(failure);
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
