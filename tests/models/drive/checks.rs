//! Invariants after every call of any driver.

use super::*;

/// Longest time in which a port takes nothing, microseconds, plus a margin.
pub(super) const STALL_US: u64 = 1_010_000;

impl DrivenLine {
    /// Checks that everything is flushed, the pin is off, and no frame is kept of which no byte has
    /// left. A refused call has not used the port.
    pub(super) fn is_left_in_order(&self, unsent: &[u8]) -> Result<(), String> {
        if !self.is_touched {
            return Ok(());
        }
        if self.pin_on_us.is_some() && !self.has_pin_failed() {
            return Err("the driver-enable pin was left on".into());
        }
        broken_if!(self.is_flush_due, "written bytes were not flushed");
        if !unsent.is_empty() && !self.wire.goes_on_with(unsent) {
            return Err("a frame was kept of which no byte has left".into());
        }
        Ok(())
    }

    /// Number of pending faults.
    pub(super) fn faults(&self) -> usize {
        self.writes.len() + self.reads.len() + self.flushes.len() + self.pins.len()
    }

    /// Number of pending faults in which the port takes nothing for a second.
    pub(super) fn stalls(&self) -> u64 {
        let writes = self.writes.iter().filter(|&&writing| writing == Writing::Stall);
        let flushes = self.flushes.iter().filter(|&&flushing| flushing == Flushing::Stall);
        (writes.count() + flushes.count()) as u64
    }

    /// The failure that has to be returned to the caller.
    pub(super) fn first_failure(&self) -> Option<Failure> {
        let mut failures = self.failures.iter().map(|&(_, failure)| failure);
        match (failures.next(), failures.next()) {
            // The resulting failure to switch the pin off is returned instead.
            (Some(Failure::WriteZero), Some(Failure::Pin(number))) => Some(Failure::Pin(number)),
            // After a failed write the pin waits for a flush that never returns.
            (Some(_), Some(Failure::Stalled)) if self.has_pin && self.has_write_failed_first => {
                Some(Failure::Stalled)
            }
            (first, _) => first,
        }
    }
}
