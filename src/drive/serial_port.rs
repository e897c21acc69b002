//! A serial port of a PC, blocking.

use alloc::boxed::Box;
use core::{fmt, ops::Range, time::Duration};
use std::{io, thread, time::Instant};

use embedded_io::{ErrorType, Read, ReadReady, Write};

use super::tty::{self, STALL, WRITE_PATIENCE, lost};

/// Length of the buffer for received bytes.
const HELD_LEN: usize = 256;

/// Longest wait in one call of the system, so that a port that has gone is noticed.
const LOOK: Duration = Duration::from_millis(50);

/// Shortest wait in one call of the system. Windows counts milliseconds, and a driver may take 0 of
/// them as no limit.
const SHORTEST_WAIT: Duration =
    if cfg!(windows) { Duration::from_millis(1) } else { Duration::ZERO };

/// Longest piece written at once. A system that says that it has room, has room for that much, and
/// would wait until it has taken all of a longer one.
const PIECE_LEN: usize = 256;

/// Pause between two looks at bytes that are being sent.
const NAP: Duration = Duration::from_micros(200);

/// A serial port of a PC, for the blocking calls of a [`Driver`](super::Driver). See
/// `guide::start_on_a_pc` for permissions, adapters and their delays.
///
/// ```no_run
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::drive::{Driver, SerialPort, StdClock};
/// use axlewire::ikeya::{BAUD, master::MasterConfig};
///
/// let port = SerialPort::open("/dev/ttyUSB0", BAUD)?;
/// let mut config = MasterConfig::usb_adapter();
/// config.accepts_early = port.is_pseudo_terminal(); // a simulated line takes no time
/// let mut bus = Driver::master(config, port, StdClock::new());
/// println!("{} nodes", bus.discover()?.len());
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # How long its calls take
///
/// * `read_ready` returns at once.
/// * `read` waits until there is a byte or the port fails. A driver calls it only when there is.
/// * `write` takes up to 256 bytes. If the system has no room for any for 20 ms, it fails with
///   [`TimedOut`](io::ErrorKind::TimedOut); the port may recover, so call the driver again.
/// * `flush` waits until all bytes are out. If the system sends none for a second, it fails with
///   `TimedOut`. The bytes that are left in the UART itself then take at most its own time, unless
///   the driver of the operating system hangs.
///
/// Signals interrupt none of them.
///
/// # Errors
///
/// An unplugged port fails in every call, with "disconnected" and the system's words. Open it again
/// by its path; what has been received from it before is still handed out.
pub struct SerialPort {
    tty: Box<dyn serialport::SerialPort>,
    /// Bytes that were received and not handed out yet are at `unread`.
    held: [u8; HELD_LEN],
    unread: Range<usize>,
}

impl SerialPort {
    /// Opens a port, such as `/dev/ttyUSB0` or `COM3`, at `baud` bit/s: 8 data bits, no parity, one
    /// stop bit, no flow control. Bytes that the system received before are discarded.
    ///
    /// On Unix other programs cannot open it meanwhile (`TIOCEXCL` and `flock`); on Windows none
    /// ever can.
    ///
    /// # Errors
    ///
    /// A text with the path and the reason: no such path, permission denied, in use, not a serial
    /// port, or a speed that the UART cannot run at, if it is off by more than 3 %.
    pub fn open(path: &str, baud: u32) -> io::Result<Self> {
        let tty = tty::open(path, baud, |builder| builder.clone().open_native())?;
        Ok(Self::from(Box::new(tty) as Box<dyn serialport::SerialPort>))
    }

    /// Whether the port is a pseudo-terminal, by its name. It has no line speed: an answer may come
    /// before a real line could have carried it. So set
    /// [`MasterConfig::accepts_early`](crate::ikeya::master::MasterConfig::accepts_early) to this.
    #[must_use]
    pub fn is_pseudo_terminal(&self) -> bool {
        tty::is_pseudo_terminal(&*self.tty)
    }

    /// Checks that the port runs at `baud` bit/s, as [`open`](Self::open) does, where the system
    /// can tell.
    ///
    /// # Errors
    ///
    /// A text with both speeds, if they differ by more than 3 %: a UART would not read the bytes.
    pub fn check_baud(&self, baud: u32) -> io::Result<()> {
        tty::check_baud(&*self.tty, baud)
            .map_err(|cause| io::Error::new(io::ErrorKind::InvalidInput, cause))
    }

    /// The port of the `serialport` crate, to read or change its settings. Its timeout is changed
    /// by every call here.
    pub fn get_mut(&mut self) -> &mut dyn serialport::SerialPort {
        &mut *self.tty
    }

    /// The port of the `serialport` crate. Bytes that were received and not handed out are
    /// discarded.
    #[must_use]
    pub fn into_inner(self) -> Box<dyn serialport::SerialPort> {
        self.tty
    }

    /// Waits for received bytes, at most for `patience`, however many signals interrupt it; returns
    /// whether there are some. A [`Clock`](super::Clock) of your own can idle with it.
    ///
    /// # Errors
    ///
    /// The port has gone.
    pub fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if !self.unread.is_empty() {
            return Ok(true);
        }
        self.receive(patience)
    }

    fn receive(&mut self, patience: Duration) -> io::Result<bool> {
        let deadline = Instant::now() + patience;
        // Not every Windows driver returns a read at its first byte, so ask for one byte there.
        let asked = if cfg!(windows) { 1 } else { HELD_LEN };
        let count = self.read_at(0, asked, deadline)?;
        self.unread = 0..count;
        if cfg!(windows) && count > 0 {
            let more = self.tty.bytes_to_read().map_err(lost)?;
            // What is there already comes at once.
            self.unread.end += self.read_at(count, more as usize, deadline)?;
        }
        Ok(count > 0)
    }

    /// Reads up to `len` bytes into the buffer, from `at`; 0 if none has come by `deadline`.
    fn read_at(&mut self, at: usize, len: usize, deadline: Instant) -> io::Result<usize> {
        let free = self.held.get_mut(at..).unwrap_or_default();
        let len = len.min(free.len());
        let free = free.get_mut(..len).unwrap_or_default();
        if free.is_empty() {
            return Ok(0);
        }
        let mut is_last = false;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            self.tty.set_timeout(left.max(SHORTEST_WAIT)).map_err(lost)?;
            match self.tty.read(free) {
                Ok(0) => return Err(lost(io::ErrorKind::UnexpectedEof)),
                Ok(count) => return Ok(count.min(len)),
                Err(error) => match error.kind() {
                    // Signals that never end must not make it wait for ever. One of them may come
                    // in the last look.
                    io::ErrorKind::Interrupted if !is_last => is_last = left.is_zero(),
                    io::ErrorKind::Interrupted
                    | io::ErrorKind::TimedOut
                    | io::ErrorKind::WouldBlock => return Ok(0),
                    _ => return Err(lost(error)),
                },
            }
        }
    }
}

/// A port that is already open, as it is: bytes that it has received are not discarded, and its
/// speed is not checked.
///
/// ```no_run
/// let tty = serialport::new("/dev/ttyUSB0", 500_000).open()?; // with settings of your own
/// let port = axlewire::drive::SerialPort::from(tty);
/// port.check_baud(500_000)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl From<Box<dyn serialport::SerialPort>> for SerialPort {
    fn from(tty: Box<dyn serialport::SerialPort>) -> Self {
        Self { tty, held: [0; HELD_LEN], unread: 0..0 }
    }
}

impl fmt::Debug for SerialPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unread = self.unread.len();
        f.debug_struct("SerialPort")
            .field("name", &self.tty.name())
            .field("unread", &unread)
            .finish()
    }
}

impl ErrorType for SerialPort {
    type Error = io::Error;
}

impl ReadReady for SerialPort {
    fn read_ready(&mut self) -> io::Result<bool> {
        if !self.unread.is_empty() {
            return Ok(true);
        }
        // Windows has no read that returns at once. Elsewhere the count would be zero for ever if
        // the other end has gone, but a read fails.
        if cfg!(windows) {
            let count = self.tty.bytes_to_read().map_err(lost)?;
            return if count > 0 { self.receive(LOOK) } else { Ok(false) };
        }
        self.receive(Duration::ZERO)
    }
}

impl Read for SerialPort {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while self.unread.is_empty() {
            self.receive(LOOK)?;
        }
        let unread = self.held.get(self.unread.clone()).unwrap_or_default();
        let count = unread.len().min(buffer.len());
        buffer.iter_mut().zip(unread).for_each(|(slot, byte)| *slot = *byte);
        self.unread.start += count;
        Ok(count)
    }
}

impl Write for SerialPort {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let piece = bytes.get(..PIECE_LEN).unwrap_or(bytes);
        let deadline = Instant::now() + WRITE_PATIENCE;
        self.tty.set_timeout(WRITE_PATIENCE).map_err(lost)?;
        loop {
            match self.tty.write(piece) {
                // So Windows says that the time is over.
                Ok(0) => return Err(io::ErrorKind::TimedOut.into()),
                Ok(count) => return Ok(count),
                Err(error) => match error.kind() {
                    io::ErrorKind::Interrupted if Instant::now() < deadline => {}
                    io::ErrorKind::Interrupted
                    | io::ErrorKind::TimedOut
                    | io::ErrorKind::WouldBlock => return Err(io::ErrorKind::TimedOut.into()),
                    _ => return Err(lost(error)),
                },
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut least = u32::MAX;
        let mut deadline = Instant::now();
        loop {
            let queued = self.tty.bytes_to_write().map_err(lost)?;
            if queued == 0 {
                // For so long a signal does not end it; a look has set it to zero.
                self.tty.set_timeout(WRITE_PATIENCE).map_err(lost)?;
                return self.tty.flush().map_err(lost);
            }
            if queued < least {
                (least, deadline) = (queued, Instant::now() + STALL);
            }
            if Instant::now() >= deadline {
                return Err(tty::stalled(queued));
            }
            thread::sleep(NAP);
        }
    }
}
