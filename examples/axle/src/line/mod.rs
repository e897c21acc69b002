//! An open line: the port of a driver, and the clock that waits for its bytes.

mod tap;
mod tcp;
mod wire;

use std::{
    cell::{Cell, RefCell},
    io,
    rc::Rc,
    time::{Duration, Instant as Clock},
};

use axlewire::{
    drive::{self, SerialPort, WithoutEcho},
    time::{self, Instant},
};
use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::{
    args::{PortArgs, Protocol},
    clock,
    failure::Failure,
    pcapng::{Background, Direction, Recording},
    signals::ABSENCE,
};
use tap::Tap;
use tcp::TcpPort;
pub(crate) use wire::Wire;

/// Longest wait for bytes, so that signals and keys are noticed in time.
pub(crate) const PATIENCE: Duration = Duration::from_millis(50);

/// Pause after a failure of the port, before a stop continues.
pub(crate) const FAILURE_PAUSE: Duration = Duration::from_millis(10);

/// Silence that ends a partial frame (ruling B3): longer than the pauses of a USB adapter.
pub(crate) const QUIET: time::Duration = time::Duration::from_millis(30);

/// A port for a driver. Its clones are the same port.
#[derive(Clone)]
pub(crate) struct Line {
    wire: Rc<RefCell<dyn Wire>>,
    path: Rc<str>,
    /// Whether an answer may come before a line of this speed could have carried it.
    is_instant: bool,
    recording: Option<SharedRecording>,
}

/// A recording of one line after another.
pub(crate) type SharedRecording = Rc<RefCell<Background>>;

impl Line {
    /// Opens a port for exclusive use, without the bytes that were received before.
    pub(crate) fn open(args: &PortArgs, protocol: Protocol) -> Result<Self, Failure> {
        let line = Self::unrecorded(args, protocol)?;
        let recording = Self::recording(args, protocol)?;
        Ok(Self { recording, ..line })
    }

    /// The same without the recording.
    pub(crate) fn unrecorded(args: &PortArgs, protocol: Protocol) -> Result<Self, Failure> {
        let mut line = Self::connect(&args.port, args.baud_for(protocol))?;
        line.is_instant |= args.instant;
        Ok(line)
    }

    /// The recording requested for this line.
    pub(crate) fn recording(
        args: &PortArgs,
        protocol: Protocol,
    ) -> Result<Option<SharedRecording>, Failure> {
        let Some(file) = &args.record else { return Ok(None) };
        let baud = args.baud_for(protocol);
        let recording = Recording::create(file, false, protocol, &args.port, baud)?;
        Ok(Some(Rc::new(RefCell::new(Background::new(recording)))))
    }

    /// The same line, recorded there.
    pub(crate) fn recorded(self, recording: Option<&SharedRecording>) -> Self {
        Self { recording: recording.cloned(), ..self }
    }

    /// The same line, whose bytes are also told.
    pub(crate) fn tapped(self, tell: impl FnMut(Direction, &[u8]) + 'static) -> Self {
        Self { wire: Rc::new(RefCell::new(Tap { wire: self.wire, tell })), ..self }
    }

    /// The same line without the echo of what is sent.
    pub(crate) fn without_echo(self) -> Self {
        let hearing_itself = Self { recording: None, ..self.clone() };
        Self { wire: Rc::new(RefCell::new(WithoutEcho::new(hearing_itself))), ..self }
    }

    /// The same line, whose bytes go through `tap`.
    #[cfg(test)]
    pub(crate) fn through<W: Wire + 'static>(
        self,
        tap: impl FnOnce(Rc<RefCell<dyn Wire>>) -> W,
    ) -> Self {
        Self { wire: Rc::new(RefCell::new(tap(self.wire))), ..self }
    }

    /// A line at this path, at this speed.
    pub(crate) fn connect(path: &str, baud: u32) -> Result<Self, Failure> {
        if let Some(address) = path.strip_prefix("tcp:") {
            let refused =
                |error: io::Error| Failure::Failed(format!("cannot use port {path:?}: {error}"));
            let port = TcpPort::connect(address).map_err(refused)?;
            let is_instant = port.is_local();
            return Ok(Self::new(path, port, is_instant));
        }
        let port =
            SerialPort::open(path, baud).map_err(|error| Failure::Failed(error.to_string()))?;
        let is_instant = port.is_pseudo_terminal();
        Ok(Self::new(path, port, is_instant))
    }

    pub(crate) fn new(path: &str, wire: impl Wire + 'static, is_instant: bool) -> Self {
        Self { wire: Rc::new(RefCell::new(wire)), path: path.into(), is_instant, recording: None }
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// Whether the line takes no time, as a pseudo-terminal and a connection within this machine:
    /// an answer may come before a real line could have carried it.
    pub(crate) const fn is_instant(&self) -> bool {
        self.is_instant
    }

    /// A clock that starts now and that idles until bytes have come.
    pub(crate) fn clock(&self) -> LineClock {
        let (wire, start) = (Rc::clone(&self.wire), clock::now());
        LineClock { wire, start, seen_at: Cell::new(Instant::from_micros(0)), awake: Rc::default() }
    }

    /// The bytes that come within `patience`, as soon as there are some.
    pub(crate) fn receive<'b>(
        &mut self,
        buffer: &'b mut [u8],
        patience: Duration,
    ) -> Result<&'b [u8], Failure> {
        let is_there = self.wire.borrow_mut().wait(patience);
        let count = match is_there {
            Ok(false) => Ok(0),
            Ok(true) => self.read(buffer),
            Err(error) => Err(error),
        };
        match count {
            Ok(count) => Ok(buffer.get(..count).unwrap_or_default()),
            Err(error) => Err(Failure::lost(&self.path, &error.to_string())),
        }
    }
}

impl Line {
    /// A failing recording does not keep anything from being sent; the failure is reported at the
    /// end.
    fn record(&self, direction: Direction, bytes: &[u8]) {
        if let Some(recording) = &self.recording {
            recording.borrow_mut().add(direction, bytes);
        }
    }

    /// Ends the recording, for use while nothing moves; fails if it is incomplete.
    pub(crate) fn check_recording(&self) -> Result<(), Failure> {
        match &self.recording {
            Some(recording) => recording.borrow_mut().check(),
            None => Ok(()),
        }
    }
}

impl ErrorType for Line {
    type Error = io::Error;
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.wire.borrow_mut().read_ready()
    }
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.wire.borrow_mut().read(buffer)?;
        self.record(Direction::In, buffer.get(..count).unwrap_or_default());
        Ok(count)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.wire.borrow_mut().write(bytes)?;
        self.record(Direction::Out, bytes.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.wire.borrow_mut().flush()
    }
}

impl Wire for WithoutEcho<Line> {
    /// Ends early if only an echo has come.
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if self.read_ready()? {
            return Ok(true);
        }
        self.port_mut().wire.borrow_mut().wait(patience)?;
        self.read_ready()
    }
}

/// The clock of a driver on this line. Waits for bytes instead of sleeping, so that answers are
/// taken in at once and an idle tool needs hardly any processor time.
pub(crate) struct LineClock {
    wire: Rc<RefCell<dyn Wire>>,
    start: Clock,
    seen_at: Cell<Instant>,
    awake: Rc<Cell<Duration>>,
}

impl LineClock {
    /// The time for which the tool has been running, for deadlines: a stop during which it was
    /// suspended still gets all of its time after a SIGCONT.
    pub(crate) fn awake(&self) -> Rc<Cell<Duration>> {
        Rc::clone(&self.awake)
    }
}

impl drive::Clock for LineClock {
    fn now(&self) -> Instant {
        let now = Instant::from_micros(clock::since(self.start).as_micros() as u64);
        let step = (now - self.seen_at.replace(now)).min(ABSENCE).as_micros();
        self.awake.set(self.awake.get() + Duration::from_micros(step.into()));
        now
    }

    fn idle_until(&mut self, until: Instant) {
        // In steps that do not count as a suspension.
        let micros = (until - self.now()).as_micros().min(ABSENCE.as_micros() / 2);
        let patience = Duration::from_micros(micros.into());
        let waited = self.wire.borrow_mut().wait(patience);
        // A failure is found again, and handled, when the driver reads.
        if waited.is_err() {
            clock::sleep(patience.min(FAILURE_PAUSE));
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use serialport::{SerialPort as _, TTYPort};

    use axlewire::drive::Clock as _;

    use super::*;
    use crate::played;

    #[test]
    fn a_port_has_the_speed_that_was_asked_for() {
        for (baud, expected) in [(None, 115_200), (Some(57_600), 57_600)] {
            let (_ours, theirs) = TTYPort::pair().unwrap();
            let path = theirs.name().unwrap();
            let args = PortArgs { port: path.clone(), ..PortArgs::new(baud) };
            let line = Line::open(&args, Protocol::Ucp).unwrap();
            assert_eq!(theirs.baud_rate().unwrap(), expected);
            assert!(line.is_instant() && line.path() == path);
        }
    }

    #[test]
    fn a_clock_idles_until_the_time_or_until_bytes_are_there() {
        let idles = |line: Line, micros| {
            let mut ours = line.clock();
            let (begin, until) = (clock::now(), ours.now() + time::Duration::from_micros(micros));
            ours.idle_until(until);
            clock::since(begin)
        };
        let silence = played::silence(true);
        assert_eq!(idles(silence.clone(), 30_000), Duration::from_millis(30));
        assert_eq!(idles(silence, 0), Duration::ZERO);
        let talk = played::played((), |(), _| vec![0]).line;
        assert_eq!(idles(talk, 60_000_000), Duration::ZERO);
    }

    #[test]
    fn a_long_wait_is_no_suspension() {
        let mut ours = played::silence(true).clock();
        let (awake, begin) = (ours.awake(), ours.now());
        let until = begin + time::Duration::from_secs(3);
        while ours.now() < until {
            ours.idle_until(until);
        }
        assert_eq!(awake.get(), Duration::from_secs(3));
    }

    #[test]
    fn a_clock_does_not_idle_for_a_time_that_is_past() {
        let mut ours = played::silence(true).clock();
        let until = ours.now() + time::Duration::from_millis(5);
        ours.idle_until(until);
        let begin = clock::now();
        ours.idle_until(Instant::from_micros(1));
        assert_eq!(clock::since(begin), Duration::ZERO);
    }

    #[test]
    fn a_suspension_is_no_time_for_which_the_tool_was_running() {
        let ours = played::silence(true).clock();
        for (millis, awake) in [(400, 400), (60_000, 900), (100, 1000)] {
            clock::sleep(Duration::from_millis(millis));
            ours.now();
            assert_eq!(ours.awake().get(), Duration::from_millis(awake));
        }
    }

    #[test]
    fn a_flush_is_one_of_the_port() {
        let mut played = played::played((), |(), _| Vec::new());
        assert!(played.line.flush().is_ok());
        played.is_gone.set(true);
        assert!(played.line.flush().is_err());
    }
}
