//! The port, the pin and the clock of a driver, all of them handles of a line.
//!
//! Unlike the port of `harness/port.rs` it numbers its failures for the account of a search, and
//! objects to a driver that breaks its contract.

use std::cell::RefMut;

use axlewire::drive::{Clock, Rs485Error};

use super::*;
use crate::names::*;

/// Delays between the pin and the first byte, and the last byte and the pin, microseconds.
const BEFORE_US: u64 = 30;
const AFTER_US: u64 = 10;

/// A hardware failure; its number within this call.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Broken(u8);

impl core::fmt::Display for Broken {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("broken")
    }
}

impl core::error::Error for Broken {}

impl embedded_io::Error for Broken {
    fn kind(&self) -> embedded_io::ErrorKind {
        embedded_io::ErrorKind::Other
    }
}

impl embedded_hal::digital::Error for Broken {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

/// A port with or without a pin.
pub(crate) trait Wired:
    embedded_io::Read
    + embedded_io::ReadReady
    + embedded_io::Write
    + embedded_io_async::Read
    + embedded_io_async::Write
    + std::fmt::Debug
{
    const HAS_PIN: bool;

    fn plug(line: &Shared) -> Self;
    fn failure(error: Self::Error) -> Failure;
}

impl Wired for Shared {
    const HAS_PIN: bool = false;

    fn plug(line: &Shared) -> Self {
        line.clone()
    }

    fn failure(error: Broken) -> Failure {
        Failure::Port(error.0)
    }
}

/// The pin, with its delays.
#[derive(Clone, Debug)]
pub(crate) struct Pin(pub(super) Shared);

impl Wired for Rs485<Shared, Pin, Pin> {
    const HAS_PIN: bool = true;

    fn plug(line: &Shared) -> Self {
        let [before, after] = [BEFORE_US, AFTER_US].map(|us| Duration::from_micros(us as u32));
        let pin = Pin(line.clone());
        Rs485::with_delays(line.clone(), pin.clone(), pin, before, after).unwrap()
    }

    fn failure(error: Rs485Error<Broken, Broken>) -> Failure {
        match error {
            Rs485Error::Port(error) => Failure::Port(error.0),
            Rs485Error::Pin(error) => Failure::Pin(error.0),
            Rs485Error::Lost => Failure::Lost,
        }
    }
}

/// A port's part in a driver's errors.
pub(crate) fn failure<P: Wired>(error: DriveError<P::Error>) -> Option<Failure> {
    match error {
        DriveError::Port(error) => Some(P::failure(error)),
        DriveError::Closed => Some(Failure::Closed),
        DriveError::WriteZero => Some(Failure::WriteZero),
        DriveError::Stalled => Some(Failure::Stalled),
        _ => None,
    }
}

impl embedded_hal::digital::ErrorType for Pin {
    type Error = Broken;
}

impl embedded_hal::digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Broken> {
        let mut line = self.0.line();
        line.count();
        if line.pins.front() == Some(&Pinning::Off) && line.pin_on_us.is_some() {
            line.pins.pop_front();
            return Err(Broken(line.fail(Failure::Pin)));
        }
        let is_early = line.now_us < line.free_us + AFTER_US;
        if is_early && line.pin_on_us.is_some() && !line.is_given_up && !line.has_pin_failed() {
            line.object("the driver-enable pin goes off while bytes are being sent");
        }
        line.pin_on_us = None;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Broken> {
        let mut line = self.0.line();
        line.count();
        line.pin_on_us = Some(line.now_us);
        if line.pins.front() == Some(&Pinning::On) {
            line.pins.pop_front();
            return Err(Broken(line.fail(Failure::Pin)));
        }
        Ok(())
    }
}

impl Shared {
    pub(crate) fn line(&self) -> RefMut<'_, DrivenLine> {
        self.0.borrow_mut()
    }

    pub(super) fn begin_write(&self, bytes: &[u8]) -> Option<Writing> {
        assert!(!bytes.is_empty(), "nothing to write");
        let mut line = self.line();
        line.count();
        line.is_touched = true;
        line.writes_in_call += 1;
        let now_us = line.now_us;
        line.first_write_us.get_or_insert(now_us);
        line.is_flush_due = true;
        if line.has_pin {
            match line.pin_on_us {
                None => line.object("written with the driver-enable pin off"),
                Some(on_us) if line.now_us < on_us + BEFORE_US => {
                    line.object("written before the transceiver has settled");
                }
                Some(_) => {}
            }
        }
        let (now_us, role_us) = (line.now_us, line.role_now().as_micros());
        // What has arrived is taken in before the rest is offered, unless the port fails.
        if line.wire.goes_on_with(bytes) && line.wire.open[0] == 0xBB && line.failures.is_empty() {
            let doubts_us = line.peer.doubts_us();
            if (line.wire.begun_us + 1..=now_us).contains(&doubts_us) {
                line.object("the rest of a WRITE is offered after an answer in the other mode");
            }
        }
        if let Err(invariant) = line.wire.offer(bytes, now_us, role_us) {
            line.object(&invariant);
        }
        line.writes.pop_front()
    }

    pub(super) fn end_write(
        &self,
        bytes: &[u8],
        writing: Option<Writing>,
        begun_us: u64,
    ) -> Result<usize, Broken> {
        let mut line = self.line();
        let is_failure = matches!(writing, Some(Writing::Error | Writing::Stall | Writing::Zero));
        line.has_write_failed_first |= is_failure && line.failures.is_empty();
        let count = match writing {
            None => bytes.len(),
            Some(Writing::Held) => {
                (line.held, line.held_since_us) = (bytes.to_vec(), begun_us);
                return Ok(bytes.len());
            }
            Some(Writing::One | Writing::Slow) => 1,
            Some(Writing::Half | Writing::Part) => bytes.len().div_ceil(2),
            Some(Writing::Error | Writing::Stall) => return Err(Broken(line.fail(Failure::Port))),
            Some(Writing::Zero) => {
                line.failed(Failure::WriteZero);
                return Ok(0);
            }
        };
        line.release();
        line.carry(&bytes[..count], begun_us);
        Ok(count)
    }

    pub(super) fn begin_flush(&self) -> Option<Flushing> {
        let mut line = self.line();
        line.count();
        line.is_flush_due = false;
        line.flushes.pop_front()
    }

    /// When a flush begins to send what is held.
    pub(super) fn held_until_us(&self, flushing: Option<Flushing>) -> u64 {
        let line = self.line();
        let late_us = line.wire.too_late_us(line.now_us);
        if flushing == Some(Flushing::Late) { late_us } else { line.now_us }
    }

    pub(super) fn release(&self, flushing: Option<Flushing>) {
        if matches!(flushing, None | Some(Flushing::Late | Flushing::ErrorLeft)) {
            self.line().release();
        }
    }

    pub(super) fn end_flush(&self, flushing: Option<Flushing>) -> Result<(), Broken> {
        let mut line = self.line();
        if flushing.is_some_and(|flushing| flushing != Flushing::Late) {
            line.held.clear();
            line.is_given_up = true;
            line.wire.flush_failed();
            return Err(Broken(line.fail(Failure::Port)));
        }
        line.wire.flushed();
        Ok(())
    }

    fn ready(&self) -> Result<bool, Broken> {
        let mut line = self.line();
        line.count();
        line.is_touched = true;
        let reading = line.reading();
        if reading == Some(Reading::ReadyError) {
            line.reads.pop_front();
            return Err(Broken(line.fail(Failure::Port)));
        }
        Ok(reading.is_some() || line.has_arrived())
    }

    pub(super) fn give(&self, buffer: &mut [u8]) -> Result<usize, Broken> {
        assert!(!buffer.is_empty(), "an empty buffer would look like an end of file");
        let mut line = self.line();
        line.count();
        let reading = line.reading();
        if reading.is_some() {
            line.reads.pop_front();
        }
        let most = match reading {
            None => buffer.len(),
            Some(Reading::One) => 1,
            Some(Reading::Zero) => {
                line.failed(Failure::Closed);
                return Ok(0);
            }
            Some(_) => return Err(Broken(line.fail(Failure::Port))),
        };
        let mut count = 0;
        while count < most && line.has_arrived() {
            buffer[count] = line.inbox.pop_front().map_or(0, |(_, byte)| byte);
            count += 1;
        }
        assert!(count > 0, "a read without a byte would block forever");
        Ok(count)
    }
}

impl Clock for Shared {
    fn now(&self) -> Instant {
        self.line().clock()
    }

    fn idle_until(&mut self, until: Instant) {
        self.line().idle_until(until);
    }
}

impl embedded_io::ErrorType for Shared {
    type Error = Broken;
}

impl embedded_io::ReadReady for Shared {
    fn read_ready(&mut self) -> Result<bool, Broken> {
        self.ready()
    }
}

impl embedded_io::Read for Shared {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Broken> {
        self.give(buffer)
    }
}

pub(super) const SECOND_US: u64 = 1_000_000;
/// Most of the longest pause inside a frame.
pub(super) const PART_US: u64 = 70;

impl embedded_io::Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Broken> {
        let begun_us = self.line().now_us;
        let writing = self.begin_write(bytes);
        let end_us = match writing {
            Some(Writing::Slow) => self.line().wire.too_late_us(begun_us),
            Some(Writing::Part) => begun_us + PART_US,
            Some(Writing::Stall) => begun_us + SECOND_US,
            _ => begun_us,
        };
        self.line().pass_until(end_us);
        self.end_write(bytes, writing, begun_us)
    }

    fn flush(&mut self) -> Result<(), Broken> {
        let flushing = self.begin_flush();
        let held_until_us = self.held_until_us(flushing);
        self.line().pass_until(held_until_us);
        self.release(flushing);
        let end_us = match flushing {
            None | Some(Flushing::Late) => self.line().free_us,
            Some(Flushing::Stall) => self.line().now_us + SECOND_US,
            Some(_) => 0,
        };
        self.line().pass_until(end_us);
        self.end_flush(flushing)
    }
}

impl embedded_hal::delay::DelayNs for Pin {
    fn delay_ns(&mut self, ns: u32) {
        let end_us = self.0.line().now_us + u64::from(ns.div_ceil(1000));
        self.0.line().pass_until(end_us);
    }
}
