//! A serial port and a clock, and the loop that drives a role over them.

use std::{
    fs,
    io::{ErrorKind, Read, Write},
    time::{Duration, Instant as Clock},
};

use axlewire::{endpoint::Endpoint, time::Instant};
use serialport::SerialPort;

use crate::{args, failure::Failure};

/// Longest wait for bytes, so that Ctrl-C is seen in time. Nothing spins: each round of a loop
/// waits for bytes, for the role's next deadline, or for so long.
const PATIENCE: Duration = Duration::from_millis(50);

/// How long a port may take no byte at all before it has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);

/// How far from what was asked for a speed may be, percent: a UART still reads its bytes.
const BAUD_TOLERANCE_PCT: u64 = 3;

/// Bytes one way, bytes the other way, and time.
pub(crate) trait Line {
    /// The time since the line was opened.
    fn now(&self) -> Instant;

    /// Sends all of `bytes`.
    fn send(&mut self, bytes: &[u8]) -> Result<(), Failure>;

    /// Waits for bytes, until `until` or a moment at the most; none is no failure.
    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure>;

    /// One round of the loop that [`Endpoint`] describes, from sending to the next deadline: sends,
    /// waits until `until` at the most, and hands in what came. Events and commands are the
    /// caller's, between two rounds.
    fn round<E: Endpoint>(&mut self, role: &mut E, until: Instant) -> Result<(), Failure> {
        while let Some(frame) = role.poll_transmit(self.now()) {
            self.send(frame)?;
        }
        let until = role.poll_timeout().map_or(until, |deadline| deadline.min(until));
        let received = self.receive(until)?.to_vec();
        let now = self.now();
        role.handle_input(&received, now);
        if role.poll_timeout().is_some_and(|deadline| now >= deadline) {
            role.handle_timeout(now);
        }
        Ok(())
    }
}

/// An open serial port.
pub(crate) struct Port {
    path: String,
    tty: Box<dyn SerialPort>,
    start: Clock,
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
        Self { path, tty, start: Clock::now(), buffer: [0; 4096] }
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
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

    fn lost(&self, cause: &str) -> Failure {
        Failure::PortLost { path: self.path.clone(), cause: cause.to_owned(), moving: None }
    }
}

impl Line for Port {
    fn now(&self) -> Instant {
        Instant::from_micros(self.start.elapsed().as_micros() as u64)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.set_timeout(WRITE_TIMEOUT)?;
        self.tty.write_all(bytes).map_err(|error| match error.kind() {
            ErrorKind::TimedOut => self.lost("it takes no more bytes"),
            _ => self.lost(&format!("it has vanished ({error})")),
        })
    }

    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure> {
        self.fill(until).map(|bytes| &*bytes)
    }
}

/// Nothing came, or a signal did.
fn is_moment(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
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
mod tests {
    use super::is_close;

    #[test]
    fn a_speed_that_a_uart_would_not_read_is_another_speed() {
        assert!(is_close(500_000, 500_000) && is_close(115_200, 115_384));
        assert!(!is_close(500_000, 9600) && !is_close(500_000, 460_800) && !is_close(1, 0));
    }
}
