//! Time, in microseconds.

use axlewire::time::{Duration, Instant, Wrapping32};

use crate::{memory::read, result::axle_result};

/// Extends a timer of 32 bits, which wraps every 71 minutes, to the 64 bits of the other functions.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct axle_clock32 {
    /// The time of the latest reading, microseconds; 0 at the start.
    pub latest_us: u64,
}
plain!(axle_clock32);

/// The time at this reading of a timer of 32 bits that counts microseconds; 0 if `clock` is null.
///
/// Start with a `clock` of zeros. Pass readings in order, at least one every 71 minutes, and none
/// from an interrupt while another is passed.
#[unsafe(no_mangle)]
pub extern "C" fn axle_clock32_at(clock: *mut axle_clock32, timer_us: u32) -> u64 {
    let update = || -> Result<u64, axle_result> {
        let latest = read(clock)?.latest_us;
        let timer = Wrapping32::new();
        let before = timer.at(latest as u32);
        let latest_us = (at(latest) + (timer.at(timer_us) - before)).as_micros();
        crate::memory::Out::new(clock)?.write(axle_clock32 { latest_us });
        Ok(latest_us)
    };
    update().unwrap_or(0)
}

/// Time that so many bytes take on a line, 10 bit times each, microseconds (ruling B6).
#[unsafe(no_mangle)]
pub extern "C" fn axle_wire_time_us(bytes: usize, baud: u32) -> u32 {
    axlewire::time::wire_time(bytes, baud).as_micros()
}

pub(crate) const fn at(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

pub(crate) const fn span(micros: u32) -> Duration {
    Duration::from_micros(micros)
}

/// A setting that 0 switches off.
pub(crate) fn optional(micros: u32) -> Option<Duration> {
    (micros > 0).then(|| span(micros))
}

pub(crate) fn micros(span: Option<Duration>) -> u32 {
    span.map_or(0, Duration::as_micros)
}
