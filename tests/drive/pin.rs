//! A driver-enable pin and a delay that record their calls, around a scripted port.

use std::{cell::Cell, rc::Rc, task::Poll};

use axlewire::drive::NoDelay;

use crate::{port::Log, rig::*};

#[derive(Clone, Default)]
pub(crate) struct Pin {
    pub(crate) log: Log,
    /// The next calls fail, this many of them.
    pub(crate) failures: Rc<Cell<usize>>,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Stuck;

impl embedded_hal::digital::Error for Stuck {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl embedded_hal::digital::ErrorType for Pin {
    type Error = Stuck;
}

impl Pin {
    fn set(&self, to: &str) -> Result<(), Stuck> {
        if self.failures.get() > 0 {
            self.failures.set(self.failures.get() - 1);
            self.log.borrow_mut().push(format!("{to}!"));
            return Err(Stuck);
        }
        self.log.borrow_mut().push(to.into());
        Ok(())
    }
}

impl embedded_hal::digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Stuck> {
        self.set("off")
    }

    fn set_high(&mut self) -> Result<(), Stuck> {
        self.set("on")
    }
}

pub(crate) struct Delay {
    log: Log,
    /// Async delays never finish, this many times.
    stalls: usize,
}

impl embedded_hal::delay::DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        self.log.borrow_mut().push(format!("{ns} ns"));
    }
}

impl embedded_hal_async::delay::DelayNs for Delay {
    async fn delay_ns(&mut self, ns: u32) {
        self.log.borrow_mut().push(format!("{ns} ns"));
        if self.stalls > 0 {
            self.stalls -= 1;
            std::future::pending::<()>().await;
        }
    }
}

pub(crate) type Pinned<D> = Rs485<Port, Pin, D>;

/// A port that records its calls here.
pub(crate) fn logged(script: Port, log: &Log) -> Port {
    Port { log: Some(log.clone()), ..script }
}

pub(crate) fn undelayed(script: Port) -> (Pinned<NoDelay>, Log, Pin) {
    let pin = Pin::default();
    let log = pin.log.clone();
    (Rs485::new(logged(script, &log), pin.clone()).unwrap(), log, pin)
}

pub(crate) fn delayed(script: Port, stalls: usize) -> (Pinned<Delay>, Log) {
    let pin = Pin::default();
    let log = pin.log.clone();
    let port = logged(script, &log);
    let delay = Delay { log: log.clone(), stalls };
    let (before, after) = (Duration::from_micros(5), Duration::from_micros(7));
    (Rs485::with_delays(port, pin, delay, before, after).unwrap(), log)
}

pub(crate) fn drain(log: &Log) -> String {
    let entries = std::mem::take(&mut *log.borrow_mut());
    entries.join(" ")
}

/// An async call that is ready at once, or has yielded once because it fails.
pub(crate) fn ready<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    for _ in 0..2 {
        if let Poll::Ready(output) = poll(future.as_mut()) {
            return output;
        }
    }
    panic!("not ready")
}

/// A write and a flush, blocking and async.
pub(crate) fn write<D>(
    port: &mut Pinned<D>,
    is_async: bool,
    bytes: &[u8],
) -> Result<usize, Rs485Error<Unplugged, Stuck>>
where
    D: embedded_hal::delay::DelayNs + embedded_hal_async::delay::DelayNs,
{
    if is_async {
        ready(embedded_io_async::Write::write(port, bytes))
    } else {
        embedded_io::Write::write(port, bytes)
    }
}

pub(crate) fn flush<D>(
    port: &mut Pinned<D>,
    is_async: bool,
) -> Result<(), Rs485Error<Unplugged, Stuck>>
where
    D: embedded_hal::delay::DelayNs + embedded_hal_async::delay::DelayNs,
{
    if is_async {
        ready(embedded_io_async::Write::flush(port))
    } else {
        embedded_io::Write::flush(port)
    }
}

/// A role whose port has a pin.
pub(crate) type PinnedDriver = On<Recorder, Pinned<NoDelay>, World>;

pub(crate) fn serve(
    driver: &mut PinnedDriver,
    is_async: bool,
) -> Result<(), DriveError<Rs485Error<Unplugged, Stuck>>> {
    if is_async { ready(driver.asynch().service()) } else { driver.service() }
}

/// Whether the pin is on, as far as it has followed its calls.
pub(crate) fn is_on(log: &Log) -> bool {
    let log = log.borrow();
    log.iter().rev().find(|entry| ["on", "off"].contains(&entry.as_str())).unwrap() == "on"
}
