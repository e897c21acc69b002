//! What holds after every call of any driver.

use super::{
    fault::{Failure, Flushing, Writing},
    line::Line,
};

/// Longest time in which a port takes nothing, microseconds, and some more.
pub(super) const STALL_US: u64 = 1_010_000;

impl Line {
    /// Is everything flushed, the pin off, and no frame kept of which no byte has left? A call that
    /// was refused has not asked the port for anything.
    pub(super) fn is_left_in_order(&self, unsent: &[u8]) -> Result<(), String> {
        if !self.is_touched {
            return Ok(());
        }
        if self.pin_on_us.is_some() && !self.has_pin_failed() {
            return Err("the driver-enable pin is left on".into());
        }
        if self.is_flush_due {
            return Err("what was written is not flushed".into());
        }
        if !unsent.is_empty() && !self.wire.goes_on_with(unsent) {
            return Err("a frame of which no byte has left is kept".into());
        }
        Ok(())
    }

    /// Faults that wait to happen.
    pub(super) fn faults(&self) -> usize {
        self.writes.len() + self.reads.len() + self.flushes.len() + self.pins.len()
    }

    /// Those of them in which the port takes nothing for a second.
    pub(super) fn stalls(&self) -> u64 {
        let writes = self.writes.iter().filter(|&&writing| writing == Writing::Stall);
        let flushes = self.flushes.iter().filter(|&&flushing| flushing == Flushing::Stall);
        (writes.count() + flushes.count()) as u64
    }

    /// The failure that a caller has to be told of.
    pub(super) fn first_failure(&self) -> Option<Failure> {
        let mut failures = self.failures.iter().map(|&(_, failure)| failure);
        match (failures.next(), failures.next()) {
            // The pin that did not go off because of it is told instead.
            (Some(Failure::WriteZero), Some(Failure::Pin(number))) => Some(Failure::Pin(number)),
            // Behind a write that failed the pin waits for a flush, and does not come back from it.
            (Some(_), Some(Failure::Stalled)) if self.has_pin && self.has_write_failed_first => {
                Some(Failure::Stalled)
            }
            (first, _) => first,
        }
    }
}
