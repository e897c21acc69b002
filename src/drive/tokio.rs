//! A serial port of a PC and a clock, for tokio.

use core::{future::poll_fn, pin::Pin, time::Duration};
use std::io;

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorType, Read, Write};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_serial::SerialStream;

use super::{
    clock::Clock,
    tty::{self, lost},
};
use crate::time::Instant;

/// Pause between two looks at bytes that are being sent: the shortest that tokio has.
const NAP: Duration = Duration::from_millis(1);

/// A serial port of a PC, for an [async driver](super::asynch::Driver) in a tokio runtime.
/// See `guide::start_on_a_pc` for permissions, adapters and their delays.
///
/// ```no_run
/// # #[cfg(feature = "ikeya")]
/// # async fn run() -> Result<(), Box<dyn std::error::Error>> {
/// use axlewire::drive::{TokioClock, TokioSerialPort, asynch::Driver};
/// use axlewire::ikeya::{BAUD, master::MasterConfig};
///
/// let port = TokioSerialPort::open("/dev/ttyUSB0", BAUD)?;
/// let mut config = MasterConfig::usb_adapter();
/// config.accepts_early = port.is_pseudo_terminal(); // a simulated line takes no time
/// let mut bus = Driver::master(config, port, TokioClock::new());
/// println!("{} nodes", bus.discover().await?.len());
/// # Ok(())
/// # }
/// ```
///
/// A `read` or `write` that is dropped before it is ready has moved no bytes. A `read` finds bytes
/// that the system has received while the runtime was busy, so a driver dates them right.
///
/// `flush` waits until the system has sent all bytes, and then blocks its thread until the UART's
/// own buffer is empty: 16 bytes, 1.4 ms at 115,200 bit/s, in the usual UART. It has no limit of
/// its own; a driver gives up after a second.
///
/// # Errors
///
/// An unplugged port fails in every call, or is at its end
/// ([`DriveError::Closed`](super::DriveError::Closed)).
#[derive(Debug)]
pub struct TokioSerialPort {
    tty: SerialStream,
}

impl TokioSerialPort {
    /// Opens a port as `SerialPort::open` does: for exclusive use, 8 data bits, no parity, one stop
    /// bit, no flow control, without the bytes that the system received before.
    ///
    /// # Errors
    ///
    /// A text with the path and the reason, as there; and outside a tokio runtime.
    ///
    /// # Panics
    ///
    /// In a runtime without I/O (`enable_io` of its builder). `#[tokio::main(flavor =
    /// "current_thread")]` has it, and timers; it needs the features `macros` and `rt` of tokio.
    pub fn open(path: &str, baud: u32) -> io::Result<Self> {
        tokio::runtime::Handle::try_current().map_err(io::Error::other)?;
        let tty = tty::open(path, baud, SerialStream::open)?;
        Ok(Self::from(tty))
    }

    /// Whether the port is a pseudo-terminal, by its name. It has no line speed: an answer may come
    /// before a real line could have carried it. So set `MasterConfig::accepts_early` to this.
    #[must_use]
    pub fn is_pseudo_terminal(&self) -> bool {
        tty::is_pseudo_terminal(&self.tty)
    }

    /// The port of the `tokio-serial` crate, to read or change its settings.
    pub const fn get_mut(&mut self) -> &mut SerialStream {
        &mut self.tty
    }

    /// The port of the `tokio-serial` crate.
    #[must_use]
    pub fn into_inner(self) -> SerialStream {
        self.tty
    }
}

/// A port that is already open, as it is: its speed is not checked, and bytes that it has received
/// are not discarded.
impl From<SerialStream> for TokioSerialPort {
    fn from(tty: SerialStream) -> Self {
        Self { tty }
    }
}

impl ErrorType for TokioSerialPort {
    type Error = io::Error;
}

impl Read for TokioSerialPort {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // The runtime hears of new bytes only between two tasks.
        match self.tty.try_read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            found => return found.map_err(lost),
        }
        poll_fn(|context| {
            let mut buffer = ReadBuf::new(buffer);
            let polled = Pin::new(&mut self.tty).poll_read(context, &mut buffer);
            polled.map_ok(|()| buffer.filled().len())
        })
        .await
        .map_err(lost)
    }
}

impl Write for TokioSerialPort {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        poll_fn(|context| Pin::new(&mut self.tty).poll_write(context, bytes)).await.map_err(lost)
    }

    async fn flush(&mut self) -> io::Result<()> {
        // Not `poll_flush`, which hides errors.
        drain(&mut self.tty, serialport::SerialPort::bytes_to_write, io::Write::flush).await
    }
}

/// Waits until the system holds no bytes, while other tasks run, and then for the UART.
async fn drain<T>(
    tty: &mut T,
    held: impl Fn(&T) -> serialport::Result<u32>,
    flush: impl FnOnce(&mut T) -> io::Result<()>,
) -> io::Result<()> {
    while held(tty).map_err(lost)? > 0 {
        tokio::time::sleep(NAP).await;
    }
    flush(tty).map_err(lost)
}

/// The clock and the delay of a tokio runtime, starting at 0. The runtime must have timers
/// (`enable_time` of its builder).
///
/// tokio's timers count milliseconds. So a role notices a missing answer one or two milliseconds
/// late; what has been received wakes it at once.
#[derive(Clone, Copy, Debug)]
pub struct TokioClock {
    zero: tokio::time::Instant,
}

impl TokioClock {
    /// A clock that starts at 0.
    #[must_use]
    pub fn new() -> Self {
        Self { zero: tokio::time::Instant::now() }
    }
}

/// [`new`](TokioClock::new).
impl Default for TokioClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for TokioClock {
    fn now(&self) -> Instant {
        Instant::from_micros(self.zero.elapsed().as_micros() as u64)
    }
}

impl DelayNs for TokioClock {
    async fn delay_ns(&mut self, ns: u32) {
        tokio::time::sleep(Duration::from_nanos(ns.into())).await;
    }
}

#[cfg(test)]
mod tests {
    use core::{
        cell::Cell,
        pin::pin,
        task::{Context, Waker},
    };

    use super::*;

    /// Bytes that the system still holds, fewer at each look, and whether the UART was waited for.
    type Held = (Cell<u32>, bool);

    #[test]
    fn a_flush_lets_other_tasks_run_while_the_system_holds_bytes_and_then_waits_for_the_uart() {
        let held = |tty: &Held| Ok(tty.0.replace(tty.0.get().saturating_sub(1)));
        let flush = |tty: &mut Held| {
            assert_eq!(tty.0.get(), 0, "it would block its thread");
            tty.1 = true;
            Ok(())
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(async {
            let (mut tty, start) = ((Cell::new(3), false), std::time::Instant::now());
            {
                let mut drained = pin!(drain(&mut tty, held, flush));
                let mut context = Context::from_waker(Waker::noop());
                assert!(drained.as_mut().poll(&mut context).is_pending());
                drained.await.unwrap();
            }
            assert!(tty.1, "the UART was not waited for");
            assert!(start.elapsed() < Duration::from_secs(2), "the naps are long");
            let gone = |_: &mut Held| Err(io::ErrorKind::BrokenPipe.into());
            assert!(drain(&mut tty, held, gone).await.is_err());
        });
    }
}
