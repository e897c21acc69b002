//! A serial port with a clock, and the loop that runs a role on them.

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

/// Longest wait for bytes, so that signals are noticed in time. No loop spins: each round waits for
/// bytes, for the role's next deadline, or for this long.
const PATIENCE: Duration = Duration::from_millis(50);

/// Longest wait for the port to accept more of a frame. After that the role decides again what to
/// send, so that no outdated command leaves late (ruling U16).
const FRAME_PATIENCE: Duration = Duration::from_millis(20);

/// Time after which a port that accepts no byte has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);

/// Maximum number of frames sent in one round, so that no role keeps signals from being noticed.
const FRAMES: usize = 8;

/// Deviation from the requested baud rate at which a UART still reads the bytes, percent.
const BAUD_TOLERANCE_PCT: u64 = 3;

/// A frame that was not sent completely.
#[derive(Debug)]
pub(crate) struct NotSent {
    unsent: Unsent,
    /// `None` if the port may still recover.
    failure: Option<Failure>,
}

/// Bytes in both directions, and a clock.
pub(crate) trait Transport {
    /// The time since the line was opened.
    fn now(&self) -> Instant;

    /// Sends all of `bytes`.
    fn send(&mut self, bytes: &[u8]) -> Result<(), NotSent>;

    /// Waits briefly for bytes, at most until `until`. An empty result is not a failure.
    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure>;

    /// One round of the loop that [`Endpoint`] describes: hands in what has been received, sends
    /// what is due, waits at most until `until`, and hands in what came. The caller handles events
    /// and commands between rounds.
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
            // Hand in received bytes before the next frame goes out.
            let received = self.hand_in(role, self.now());
            result = result.and(received);
        }
        result?;
        let until = role.poll_timeout().map_or(until, |deadline| deadline.min(until));
        self.hand_in(role, until)?;
        self.expire(role);
        Ok(())
    }

    /// Hands in the bytes that come until `until`.
    fn hand_in<E: Endpoint>(&mut self, role: &mut E, until: Instant) -> Result<(), Failure> {
        let received = self.receive(until)?.to_vec();
        role.handle_input(&received, self.now());
        Ok(())
    }

    /// Handles the role's deadline if it has passed.
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
    /// Time since which the port has accepted no byte, if it is stuck.
    stuck_since: Option<Clock>,
    buffer: [u8; 4096],
}

impl Port {
    /// Opens a port for exclusive use, and discards bytes received before.
    pub(crate) fn open(line: &args::PortArgs, default_baud: u32) -> Result<Self, Failure> {
        let (path, baud) = (&line.port, line.baud.unwrap_or(default_baud));
        let refused = |cause| Failure::Port { path: path.clone(), cause };
        let tty =
            serialport::new(path, baud).open().map_err(|error| refused(explain(&error, path)))?;
        if let Ok(actual) = tty.baud_rate()
            && !is_close(baud, actual)
        {
            return Err(refused(format!("it runs at {actual} bit/s instead of {baud}")));
        }
        tty.clear(serialport::ClearBuffer::Input).map_err(|error| refused(error.description))?;
        Ok(Self::new(path.clone(), tty))
    }

    /// Wraps a port that is already open.
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

    /// Like [`Transport::receive`], but the bytes are mutable.
    pub(crate) fn fill(&mut self, until: Instant) -> Result<&mut [u8], Failure> {
        let wait = Duration::from_micros((until - self.now()).as_micros().into()).min(PATIENCE);
        self.set_timeout(wait)?;
        match self.tty.read(&mut self.buffer) {
            Ok(0) => Err(self.lost("disconnected (end of file)")),
            Ok(len) => Ok(self.buffer.get_mut(..len).unwrap_or_default()),
            Err(error) if is_moment(error.kind()) => Ok(&mut []),
            Err(error) => Err(self.lost(&format!("disconnected ({error})"))),
        }
    }

    fn set_timeout(&mut self, timeout: Duration) -> Result<(), Failure> {
        self.tty.set_timeout(timeout).map_err(|error| self.lost(&error.description))
    }

    /// The failure for a write error, unless the port may still accept the next frame.
    fn write_failure(&mut self, error: &io::Error) -> Option<Failure> {
        if !is_moment(error.kind()) {
            return Some(self.lost(&format!("disconnected ({error})")));
        }
        let since = *self.stuck_since.get_or_insert_with(Clock::now);
        (since.elapsed() >= WRITE_TIMEOUT).then(|| self.lost("it accepts no more bytes"))
    }

    fn lost(&self, cause: &str) -> Failure {
        Failure::PortLost { path: self.path.clone(), cause: cause.to_owned(), moving: None }
    }
}

impl Transport for Port {
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

/// Writes all of `bytes`, or returns whether a part of them was sent.
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

/// Whether a call timed out or was interrupted by a signal.
fn is_moment(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}

/// Whether this path, or the target of this link, is a pseudo-terminal.
fn is_pseudo_terminal(path: &str) -> bool {
    let target = fs::canonicalize(path).unwrap_or_else(|_| Path::new(path).to_owned());
    // Linux has a directory of them; macOS numbers them, as in /dev/ttys003.
    let number = target.to_str().and_then(|path| path.strip_prefix("/dev/ttys"));
    target.starts_with("/dev/pts")
        || number.is_some_and(|it| cfg!(target_os = "macos") && it.parse::<u32>().is_ok())
}

/// Whether a port running at `actual` can read bytes sent at `asked`.
fn is_close(asked: u32, actual: u32) -> bool {
    u64::from(asked.abs_diff(actual)) * 100 <= u64::from(asked) * BAUD_TOLERANCE_PCT
}

/// A helpful reason why a port could not be opened.
fn explain(error: &serialport::Error, path: &str) -> String {
    use serialport::ErrorKind as Kind;

    let is_no_tty = error.description == "Not a typewriter"
        || fs::metadata(path).is_ok_and(|found| found.is_file() || found.is_dir());
    match error.kind() {
        Kind::Io(ErrorKind::NotFound) => "no such path".to_owned(),
        Kind::Io(ErrorKind::PermissionDenied) => {
            "permission denied (on Linux, serial ports belong to the group dialout)".to_owned()
        }
        _ if is_no_tty => "not a serial port".to_owned(),
        Kind::NoDevice if cfg!(unix) => "another program is using it".to_owned(),
        _ => error.description.clone(),
    }
}

#[cfg(test)]
mod tests;
