//! Drivers over ports that fail, end, stall and stutter, in virtual time: nothing is lost, nothing
//! hangs, every error is specific.

#![cfg(all(feature = "ikeya", feature = "std"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

/// High-level calls on a motor bus.
#[path = "drivers/bus.rs"]
mod bus;
/// The bus of the scenarios.
#[path = "drivers/bus_rig.rs"]
mod bus_rig;
/// Clocks and delays.
#[path = "drivers/clocks.rs"]
mod clocks;
/// The driver-enable pin of a port alone.
#[path = "drivers/driver_enable.rs"]
mod driver_enable;
/// The driver-enable pin under a driver.
#[path = "drivers/driver_enable_in_a_driver.rs"]
mod driver_enable_in_a_driver;
/// A pin that records its changes.
#[path = "drivers/driver_enable_rig.rs"]
mod driver_enable_rig;
/// The messages and sources of errors.
#[path = "drivers/errors.rs"]
mod errors;
/// Calls that fail or are dropped, and the call after them.
#[path = "drivers/failed_and_dropped_calls.rs"]
mod failed_and_dropped_calls;
#[path = "support/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
/// A role that records every call.
#[path = "drivers/recorder.rs"]
mod recorder;
/// What a driver does in one round.
#[path = "drivers/rounds.rs"]
mod rounds;
/// High-level calls on a rover link.
#[cfg(feature = "ucp")]
#[path = "drivers/rover.rs"]
mod rover;
/// Stops, and drives that end with one.
#[path = "drivers/stops.rs"]
mod stops;
/// Frames that did not leave.
#[path = "drivers/unsent_frames.rs"]
mod unsent_frames;
#[path = "support/virtual_time.rs"]
mod virtual_time;
/// Waiting for events.
#[path = "drivers/waiting.rs"]
mod waiting;
