//! A serial port and a clock, and the loop that drives a role over them.

use std::{
    fs,
    io::{self, ErrorKind, Read, Write},
    path::Path,
    time::{Duration, Instant as Clock},
};

use axlewire::{
    endpoint::{Endpoint, Unsent},
    time::Instant,
};
use serialport::SerialPort;

use crate::{args, failure::Failure};

/// Longest wait for bytes, so that a signal is seen in time. Nothing spins: each round of a loop
/// waits for bytes, for the role's next deadline, or for this long.
const PATIENCE: Duration = Duration::from_millis(50);

/// Longest wait for the port to take more of a frame. After it the role decides anew what to send,
/// so that no old command leaves late (ruling U16).
const FRAME_PATIENCE: Duration = Duration::from_millis(20);

/// Time in which a port takes no byte at all, after which it has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);

/// Frames sent in one round at the most, so that no role keeps a signal from being seen.
const FRAMES: usize = 8;

/// Difference from the speed that was asked for at which a UART still reads the bytes, percent.
const BAUD_TOLERANCE_PCT: u64 = 3;

/// A frame that did not reach the line whole.
#[derive(Debug)]
pub(crate) struct NotSent {
    unsent: Unsent,
    /// `None` where the port may yet come back.
    failure: Option<Failure>,
}

/// Bytes one way, bytes the other way, and time.
pub(crate) trait Line {
    /// The time since the line was opened.
    fn now(&self) -> Instant;

    /// Sends all of `bytes`.
    fn send(&mut self, bytes: &[u8]) -> Result<(), NotSent>;

    /// Waits for bytes, until `until` or a moment at the most; none is no failure.
    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure>;

    /// One round of the loop that [`Endpoint`] describes: takes in what has been received, sends
    /// what is due, waits until `until` at the most, and takes in what came. Events and commands are
    /// the caller's, between two rounds.
    ///
    /// What is due is sent even if receiving fails, because it may be a stop; the failure is
    /// returned afterwards.
    fn round<E: Endpoint>(&mut self, role: &mut E, until: Instant) -> Result<(), Failure> {
        let mut result = self.hand_in(role, self.now());
        for _ in 0..FRAMES {
            self.expire(role);
            let Some(frame) = role.poll_transmit(self.now()) else { break };
            if let Err(NotSent { unsent, failure }) = self.send(frame) {
                role.handle_unsent(unsent, self.now());
                result = result.and(failure.map_or(Ok(()), Err));
                break;
            }
            // Bytes that have been received go in before the next frame goes out.
            let received = self.hand_in(role, self.now());
            result = result.and(received);
        }
        result?;
        let until = role.poll_timeout().map_or(until, |deadline| deadline.min(until));
        self.hand_in(role, until)?;
        self.expire(role);
        Ok(())
    }

    /// Hands in what comes until `until`.
    fn hand_in<E: Endpoint>(&mut self, role: &mut E, until: Instant) -> Result<(), Failure> {
        let received = self.receive(until)?.to_vec();
        role.handle_input(&received, self.now());
        Ok(())
    }

    /// Lets time pass.
    fn expire<E: Endpoint>(&self, role: &mut E) {
        let now = self.now();
        if role.poll_timeout().is_some_and(|deadline| now >= deadline) {
            role.handle_timeout(now);
        }
    }
}

/// An open serial port.
pub(crate) struct Port {
    path: String,
    tty: Box<dyn SerialPort>,
    start: Clock,
    /// Since when the port has taken no byte, if it takes none.
    stuck_since: Option<Clock>,
    buffer: [u8; 4096],
}

impl Port {
    /// Opens a port for this process alone, and forgets what was received before.
    pub(crate) fn open(line: &args::Line, default_baud: u32) -> Result<Self, Failure> {
        let (path, baud) = (&line.port, line.baud.unwrap_or(default_baud));
        let refused = |cause| Failure::Port { path: path.clone(), cause };
        let tty =
            serialport::new(path, baud).open().map_err(|error| refused(explain(&error, path)))?;
        if let Ok(actual) = tty.baud_rate()
            && !is_close(baud, actual)
        {
            return Err(refused(format!("it does not run at {baud} bit/s, only at {actual}")));
        }
        tty.clear(serialport::ClearBuffer::Input).map_err(|error| refused(error.description))?;
        Ok(Self::new(path.clone(), tty))
    }

    /// A port that is open already.
    pub(crate) fn new(path: String, tty: Box<dyn SerialPort>) -> Self {
        Self { path, tty, start: Clock::now(), stuck_since: None, buffer: [0; 4096] }
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// Whether the port is a pseudo-terminal. It has no line speed: an answer may come before a
    /// real line could have carried it.
    pub(crate) fn is_pseudo_terminal(&self) -> bool {
        is_pseudo_terminal(&self.path)
    }

    /// As [`Line::receive`], with bytes that may be changed.
    pub(crate) fn fill(&mut self, until: Instant) -> Result<&mut [u8], Failure> {
        let wait = Duration::from_micros((until - self.now()).as_micros().into()).min(PATIENCE);
        self.set_timeout(wait)?;
        match self.tty.read(&mut self.buffer) {
            Ok(0) => Err(self.lost("it has vanished (end of file)")),
            Ok(len) => Ok(self.buffer.get_mut(..len).unwrap_or_default()),
            Err(error) if is_moment(error.kind()) => Ok(&mut []),
            Err(error) => Err(self.lost(&format!("it has vanished ({error})"))),
        }
    }

    fn set_timeout(&mut self, timeout: Duration) -> Result<(), Failure> {
        self.tty.set_timeout(timeout).map_err(|error| self.lost(&error.description))
    }

    /// The failure behind an error of a write, unless the port may yet take the next frame.
    fn write_failure(&mut self, error: &io::Error) -> Option<Failure> {
        if !is_moment(error.kind()) {
            return Some(self.lost(&format!("it has vanished ({error})")));
        }
        let since = *self.stuck_since.get_or_insert_with(Clock::now);
        (since.elapsed() >= WRITE_TIMEOUT).then(|| self.lost("it takes no more bytes"))
    }

    fn lost(&self, cause: &str) -> Failure {
        Failure::PortLost { path: self.path.clone(), cause: cause.to_owned(), moving: None }
    }
}

impl Line for Port {
    fn now(&self) -> Instant {
        Instant::from_micros(self.start.elapsed().as_micros() as u64)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), NotSent> {
        let untouched = Unsent::Untouched;
        self.set_timeout(FRAME_PATIENCE)
            .map_err(|failure| NotSent { unsent: untouched, failure: Some(failure) })?;
        match write_all(&mut self.tty, bytes) {
            Ok(()) => {
                self.stuck_since = None;
                Ok(())
            }
            Err((unsent, error)) => Err(NotSent { unsent, failure: self.write_failure(&error) }),
        }
    }

    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure> {
        self.fill(until).map(|bytes| &*bytes)
    }
}

/// Writes all of `bytes`, or says how much of them has left.
fn write_all(port: &mut impl Write, bytes: &[u8]) -> Result<(), (Unsent, io::Error)> {
    let mut rest = bytes;
    while !rest.is_empty() {
        let error = match port.write(rest) {
            Ok(0) => ErrorKind::WriteZero.into(),
            Ok(len) => {
                rest = rest.get(len..).unwrap_or_default();
                continue;
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => error,
        };
        let is_whole = rest.len() == bytes.len();
        return Err((if is_whole { Unsent::Untouched } else { Unsent::CutOff }, error));
    }
    Ok(())
}

/// Nothing came, or a signal did.
fn is_moment(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}

/// Is this path, or what it is a link to, the name of a pseudo-terminal?
fn is_pseudo_terminal(path: &str) -> bool {
    let target = fs::canonicalize(path).unwrap_or_else(|_| Path::new(path).to_owned());
    // Linux has a folder of them; macOS numbers them, as in /dev/ttys003.
    let number = target.to_str().and_then(|path| path.strip_prefix("/dev/ttys"));
    target.starts_with("/dev/pts")
        || number.is_some_and(|it| cfg!(target_os = "macos") && it.parse::<u32>().is_ok())
}

/// Does a port that runs at `actual` read bytes that are sent at `asked`?
fn is_close(asked: u32, actual: u32) -> bool {
    u64::from(asked.abs_diff(actual)) * 100 <= u64::from(asked) * BAUD_TOLERANCE_PCT
}

/// Why a port could not be opened, in words that help.
fn explain(error: &serialport::Error, path: &str) -> String {
    use serialport::ErrorKind as Kind;

    let is_no_tty = error.description == "Not a typewriter"
        || fs::metadata(path).is_ok_and(|found| found.is_file() || found.is_dir());
    match error.kind() {
        Kind::Io(ErrorKind::NotFound) => "there is no such path".to_owned(),
        Kind::Io(ErrorKind::PermissionDenied) => {
            "permission denied (on Linux, serial ports are for the group dialout)".to_owned()
        }
        _ if is_no_tty => "it is no serial port".to_owned(),
        Kind::NoDevice if cfg!(unix) => "another program is using it".to_owned(),
        _ => error.description.clone(),
    }
}

#[cfg(test)]
mod tests;
