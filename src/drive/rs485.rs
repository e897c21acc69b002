//! RS485 driver enable: a pin that is on while bytes are being sent.

use core::{error::Error, fmt};

use embedded_hal::digital::OutputPin;
use embedded_io as io;

use crate::time::Duration;

/// A port whose transceiver has a driver-enable pin (DE, often joined with /RE).
///
/// The pin is switched on before the first byte is written, and off when the port's `flush` reports
/// that the last byte is out, or when writing or flushing fails. So *flush after each packet*, as a
/// [`Driver`](super::Driver) does: until then no other station can speak. The port's `flush` must
/// wait for the last stop bit, not just for an empty buffer; if it does not, use the delay `after`
/// to make up for it.
///
/// If a `write` fails, it first flushes the bytes that the port took before, so that they reach the
/// line, and then switches the pin off. If that flush fails as well, the next `flush` returns
/// [`Rs485Error::Lost`].
///
/// A cancelled async `write` or `flush` leaves the pin as it is, because part of the packet may be
/// on the line. Continue with the packet, or give it up with [`release`](Self::release) or with a
/// `write` of no bytes, which switches the pin off at once. A [`Driver`](super::Driver) does the
/// latter when an async `write` or `flush` has stalled for a second.
///
/// High is on. For an active-low transceiver, pass an inverted pin.
#[derive(Debug)]
pub struct Rs485<P, O, D = NoDelay> {
    port: P,
    pin: O,
    delay: D,
    before: Duration,
    after: Duration,
    state: State,
    /// The pin went off while bytes may have been in the transmitter.
    is_lost: bool,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum State {
    Off,
    /// The pin is on, or may be, and the delay before the first byte is not over.
    Settling,
    On,
}

impl<P, O: OutputPin> Rs485<P, O> {
    /// Sends through `port` while `pin` is on. The pin is switched off first.
    ///
    /// # Errors
    ///
    /// Pin errors.
    pub fn new(port: P, pin: O) -> Result<Self, O::Error> {
        Self::with_delays(port, pin, NoDelay, Duration::ZERO, Duration::ZERO)
    }
}

impl<P, O: OutputPin, D> Rs485<P, O, D> {
    /// The same for a transceiver that needs a delay `before`, between the pin and the first byte,
    /// or `after`, between the last byte and the pin. `before` must be shorter than a millisecond
    /// in async code, where a `write` that waits is dropped and repeated.
    ///
    /// # Errors
    ///
    /// Pin errors.
    pub fn with_delays(
        port: P,
        mut pin: O,
        delay: D,
        before: Duration,
        after: Duration,
    ) -> Result<Self, O::Error> {
        pin.set_low()?;
        Ok(Self { port, pin, delay, before, after, state: State::Off, is_lost: false })
    }

    /// Switches the pin off, even if bytes are still being sent.
    ///
    /// # Errors
    ///
    /// Pin errors: it may still be on.
    pub fn release(&mut self) -> Result<(), O::Error> {
        if self.is_on() {
            // A pin that fails may have switched anyway.
            self.state = State::Settling;
        }
        self.pin.set_low()?;
        self.state = State::Off;
        Ok(())
    }

    /// Whether the pin is on, or may be after an error of the pin.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        !matches!(self.state, State::Off)
    }

    /// The port, to change its settings.
    pub fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// The port, the pin and the delay. The pin stays as it is.
    #[must_use]
    pub fn into_parts(self) -> (P, O, D) {
        (self.port, self.pin, self.delay)
    }

    /// Switches the pin on; returns the time to wait before the first byte.
    fn engage(&mut self) -> Result<Duration, O::Error> {
        match self.state {
            State::On => return Ok(Duration::ZERO),
            // A cancelled write has not waited until the end, or the pin has failed.
            State::Settling | State::Off => {}
        }
        // A pin that fails may have switched anyway.
        self.state = State::Settling;
        if let Err(error) = self.pin.set_high() {
            // Report the first error.
            let _ = self.release();
            return Err(error);
        }
        Ok(self.before)
    }

    /// Switches the pin off for a write of no bytes.
    fn give_up<E>(&mut self) -> Result<usize, Rs485Error<E, O::Error>> {
        if self.is_on() {
            self.release().map_err(Rs485Error::Pin)?;
        }
        Ok(0)
    }

    /// Ends a flush: reports once if bytes were lost before.
    fn all_out<E>(&mut self) -> Result<(), Rs485Error<E, O::Error>> {
        if core::mem::take(&mut self.is_lost) { Err(Rs485Error::Lost) } else { Ok(()) }
    }

    /// Switches the pin off because of `error`, and reports that error.
    fn fail<T, E>(&mut self, error: E) -> Result<T, Rs485Error<E, O::Error>> {
        let _ = self.release();
        Err(Rs485Error::Port(error))
    }

    /// Switches the pin off after a write that took nothing. Bytes taken before are out, or may be
    /// lost.
    fn end<E>(&mut self, written: Result<usize, E>) -> Result<usize, Rs485Error<E, O::Error>> {
        match written {
            Err(error) => self.fail(error),
            Ok(_) => self.give_up(),
        }
    }
}

/// No delay between the pin and the bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoDelay;

impl embedded_hal::delay::DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

#[cfg(feature = "embedded-io-async")]
impl embedded_hal_async::delay::DelayNs for NoDelay {
    async fn delay_ns(&mut self, _: u32) {}
}

/// An error of the port or of the pin.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Rs485Error<E, F> {
    /// The port failed.
    Port(E),
    /// The driver-enable pin failed.
    Pin(F),
    /// Bytes may not have reached the line: the port failed while sending them, and could not be
    /// flushed before the pin went off. Reported once, by the next `flush`.
    Lost,
}

impl<E: fmt::Display, F: fmt::Debug> fmt::Display for Rs485Error<E, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(error) => error.fmt(f),
            Self::Pin(error) => write!(f, "driver-enable pin failed: {error:?}"),
            Self::Lost => {
                f.write_str("bytes may have been lost: the port failed while sending them")
            }
        }
    }
}

impl<E: Error + 'static, F: fmt::Debug> Error for Rs485Error<E, F> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Port(error) => error.source(),
            Self::Pin(_) | Self::Lost => None,
        }
    }
}

impl<E: io::Error + 'static, F: fmt::Debug> io::Error for Rs485Error<E, F> {
    fn kind(&self) -> io::ErrorKind {
        match self {
            Self::Port(error) => error.kind(),
            // Pin errors have no other kind.
            Self::Pin(_) | Self::Lost => io::ErrorKind::Other,
        }
    }
}

impl<P: io::ErrorType, O: OutputPin, D> io::ErrorType for Rs485<P, O, D>
where
    P::Error: 'static,
{
    type Error = Rs485Error<P::Error, O::Error>;
}

impl<P: io::ReadReady, O: OutputPin, D> io::ReadReady for Rs485<P, O, D>
where
    P::Error: 'static,
{
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        self.port.read_ready().map_err(Rs485Error::Port)
    }
}

impl<P: embedded_io::Read, O: OutputPin, D> embedded_io::Read for Rs485<P, O, D>
where
    P::Error: 'static,
{
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, Self::Error> {
        self.port.read(buf).map_err(Rs485Error::Port)
    }
}

impl<P: embedded_io::Write, O: OutputPin, D: embedded_hal::delay::DelayNs> embedded_io::Write
    for Rs485<P, O, D>
where
    P::Error: 'static,
{
    fn write(&mut self, buf: &[u8]) -> Result<usize, Self::Error> {
        if buf.is_empty() {
            return self.give_up();
        }
        let before = self.engage().map_err(Rs485Error::Pin)?;
        if before > Duration::ZERO {
            self.delay.delay_us(before.as_micros());
        }
        self.state = State::On;
        let written = self.port.write(buf);
        if let Ok(1..) = written {
            return written.map_err(Rs485Error::Port);
        }
        self.is_lost |= self.port.flush().is_err();
        self.delay.delay_us(self.after.as_micros());
        self.end(written)
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        if let Err(error) = self.port.flush() {
            self.is_lost = false;
            return self.fail(error);
        }
        if self.is_on() {
            self.delay.delay_us(self.after.as_micros());
            self.release().map_err(Rs485Error::Pin)?;
        }
        self.all_out()
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P: embedded_io_async::Read, O: OutputPin, D> embedded_io_async::Read for Rs485<P, O, D>
where
    P::Error: 'static,
{
    async fn read(&mut self, buf: &mut [u8]) -> Result<usize, Self::Error> {
        self.port.read(buf).await.map_err(Rs485Error::Port)
    }
}

#[cfg(feature = "embedded-io-async")]
impl<P, O, D> embedded_io_async::Write for Rs485<P, O, D>
where
    P: embedded_io_async::Write,
    P::Error: 'static,
    O: OutputPin,
    D: embedded_hal_async::delay::DelayNs,
{
    async fn write(&mut self, buf: &[u8]) -> Result<usize, Self::Error> {
        if buf.is_empty() {
            return self.give_up();
        }
        let before = self.engage().map_err(Rs485Error::Pin)?;
        if before > Duration::ZERO {
            self.delay.delay_us(before.as_micros()).await;
        }
        self.state = State::On;
        let written = self.port.write(buf).await;
        if let Ok(1..) = written {
            return written.map_err(Rs485Error::Port);
        }
        self.is_lost |= self.port.flush().await.is_err();
        self.delay.delay_us(self.after.as_micros()).await;
        self.end(written)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        if let Err(error) = self.port.flush().await {
            self.is_lost = false;
            return self.fail(error);
        }
        if self.is_on() {
            self.delay.delay_us(self.after.as_micros()).await;
            self.release().map_err(Rs485Error::Pin)?;
        }
        self.all_out()
    }
}
