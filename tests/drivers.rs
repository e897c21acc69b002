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
#[path = "harness/dice.rs"]
#[allow(dead_code, reason = "others use more of it")]
mod dice;
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
/// Every call: a failing port, a refusal, a timeout.
#[macro_use]
#[path = "drivers/every_call.rs"]
mod every_call;
/// Every call of a host and of a robot.
#[cfg(feature = "ucp")]
#[path = "drivers/every_rover_call.rs"]
mod every_rover_call;
/// Waits, to the microsecond.
#[path = "drivers/exact_waits.rs"]
mod exact_waits;
/// Calls that fail or are dropped, and the call after them.
#[path = "drivers/failed_and_dropped_calls.rs"]
mod failed_and_dropped_calls;
/// Ports of which one half fails.
#[path = "drivers/half_ports.rs"]
mod half_ports;
/// Requests that a port holds back.
#[path = "drivers/held_requests.rs"]
mod held_requests;
/// Drivers that are held up.
#[path = "drivers/held_up.rs"]
mod held_up;
/// Parts, and the defaults of traits.
#[path = "drivers/parts.rs"]
mod parts;
#[path = "harness/port.rs"]
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
/// A port that takes its time.
#[path = "drivers/slow_port.rs"]
mod slow_port;
/// Stops, and drives that end with one.
#[path = "drivers/stops.rs"]
mod stops;
/// Frames that did not leave.
#[path = "drivers/unsent_frames.rs"]
mod unsent_frames;
#[path = "harness/virtual_time.rs"]
mod virtual_time;
/// Waiting for events.
#[path = "drivers/waiting.rs"]
mod waiting;
/// Tasks that wait are woken.
#[path = "drivers/waking.rs"]
mod waking;
