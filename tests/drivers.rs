//! Drivers over ports that fail, end, stall and stutter, in virtual time: nothing is lost, nothing
//! hangs, every error says what it is.

#![cfg(all(feature = "ikeya", feature = "std"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

#[path = "drivers/bus.rs"]
mod bus;
#[path = "drivers/bus_rig.rs"]
mod bus_rig;
#[path = "drivers/clocks.rs"]
mod clocks;
#[path = "drivers/driver_enable.rs"]
mod driver_enable;
#[path = "drivers/driver_enable_in_a_driver.rs"]
mod driver_enable_in_a_driver;
#[path = "drivers/driver_enable_rig.rs"]
mod driver_enable_rig;
#[path = "drivers/errors.rs"]
mod errors;
#[path = "drivers/failed_and_dropped_calls.rs"]
mod failed_and_dropped_calls;
#[path = "support/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
#[path = "drivers/recorder.rs"]
mod recorder;
#[path = "drivers/rounds.rs"]
mod rounds;
#[cfg(feature = "ucp")]
#[path = "drivers/rover.rs"]
mod rover;
#[path = "drivers/stops.rs"]
mod stops;
#[path = "drivers/unsent_frames.rs"]
mod unsent_frames;
#[path = "support/virtual_time.rs"]
mod virtual_time;
#[path = "drivers/waiting.rs"]
mod waiting;
