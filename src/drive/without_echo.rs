//! A port on a line that hears itself.

use embedded_io as io;
use heapless::Deque;

use crate::stream::Echo;

/// A port without the echo of what is sent through it, for a two-wire line whose receiver stays on
/// while sending.
///
/// ```
/// # #[cfg(feature = "ikeya")]
/// # fn open<P>(port: P, clock: impl axlewire::drive::Clock) -> Result<(), impl core::fmt::Debug>
/// # where P: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady {
/// use axlewire::{drive::{Driver, WithoutEcho}, ikeya::master::MasterConfig};
///
/// let port = WithoutEcho::new(port); // around an `Rs485`, if there is a pin
/// let config = MasterConfig::direct();
/// let mut bus = Driver::master(config, port, clock);
/// bus.discover()?;
/// println!("{} echoes were damaged", bus.port().echo().errors());
/// # Ok::<(), axlewire::drive::DriveError<P::Error>>(())
/// # }
/// ```
///
/// A byte counts as sent when the port's `write` has taken it. After a failed `write` or `flush`,
/// and after a `write` of no bytes, which gives up a frame, no echo is expected: what comes all the
/// same is noise for a role.
#[derive(Clone, Debug)]
pub struct WithoutEcho<P> {
    port: P,
    echo: Echo,
    /// Bytes of others that were read while looking for any.
    held: Deque<u8, HELD_LEN>,
}

/// Bytes read at once while looking for some that are no echo, at most.
const HELD_LEN: usize = 64;

impl<P> WithoutEcho<P> {
    /// Sends and receives through `port`.
    pub const fn new(port: P) -> Self {
        Self { port, echo: Echo::new(), held: Deque::new() }
    }

    /// What has been removed, and how often it was damaged.
    #[must_use]
    pub const fn echo(&self) -> &Echo {
        &self.echo
    }

    /// The port, to change its settings.
    pub const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// The port.
    #[must_use]
    pub fn into_inner(self) -> P {
        self.port
    }

    /// Notes what a write has taken.
    fn wrote<E>(&mut self, bytes: &[u8], written: Result<usize, E>) -> Result<usize, E> {
        match &written {
            Ok(count @ 1..) => self.echo.sent(bytes.get(..*count).unwrap_or(bytes)),
            _ => self.echo.forget(),
        }
        written
    }

    fn flushed<E>(&mut self, flushed: Result<(), E>) -> Result<(), E> {
        if flushed.is_err() {
            self.echo.forget();
        }
        flushed
    }

    /// Moves the bytes that are held into the buffer; returns their number.
    fn take_held(&mut self, buffer: &mut [u8]) -> usize {
        let held = core::iter::from_fn(|| self.held.pop_front());
        buffer.iter_mut().zip(held).map(|(to, byte)| *to = byte).count()
    }

    /// Moves what is no echo to the front of the buffer; returns its length.
    fn strip(&mut self, buffer: &mut [u8], count: usize) -> usize {
        let count = count.min(buffer.len());
        let rest = self.echo.strip(buffer.get(..count).unwrap_or_default()).len();
        buffer.copy_within(count - rest..count, 0);
        rest
    }
}

impl<P: io::ErrorType> io::ErrorType for WithoutEcho<P> {
    type Error = P::Error;
}

impl<P: io::ReadReady + io::Read> io::ReadReady for WithoutEcho<P> {
    /// Reads the echo that has come, so that a `read` does not wait behind it.
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        while self.held.is_empty() {
            if !self.port.read_ready()? {
                return Ok(false);
            }
            let mut buffer = [0; HELD_LEN];
            let count = self.port.read(&mut buffer)?;
            if count == 0 {
                // The end, which a `read` finds again.
                return Ok(true);
            }
            let rest = self.strip(&mut buffer, count);
            for &byte in buffer.iter().take(rest) {
                let _ = self.held.push_back(byte);
            }
        }
        Ok(true)
    }
}

impl<P: io::Read> io::Read for WithoutEcho<P> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        if !self.held.is_empty() {
            return Ok(self.take_held(buffer));
        }
        loop {
            let count = self.port.read(buffer)?;
            let rest = self.strip(buffer, count);
            if rest > 0 || count == 0 {
                return Ok(rest);
            }
        }
    }
}

impl<P: io::Write> io::Write for WithoutEcho<P> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        let written = self.port.write(bytes);
        self.wrote(bytes, written)
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        let flushed = self.port.flush();
        self.flushed(flushed)
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P: embedded_io_async::Read> embedded_io_async::Read for WithoutEcho<P> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        if !self.held.is_empty() {
            return Ok(self.take_held(buffer));
        }
        loop {
            let count = self.port.read(buffer).await?;
            let rest = self.strip(buffer, count);
            if rest > 0 || count == 0 {
                return Ok(rest);
            }
        }
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P: embedded_io_async::Write> embedded_io_async::Write for WithoutEcho<P> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        let written = self.port.write(bytes).await;
        self.wrote(bytes, written)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        let flushed = self.port.flush().await;
        self.flushed(flushed)
    }
}
