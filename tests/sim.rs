//! The simulated line and its stations: what it does to bytes, to time and to roles.
#![cfg(feature = "sim")]

/// How a station is driven, and endpoints that break the contract.
#[path = "sim/drivers.rs"]
mod drivers;
/// Limits, to the microsecond and to the byte.
#[path = "sim/exact.rs"]
mod exact;
/// Faults of a line and of its stubs.
#[path = "sim/faults.rs"]
mod faults;
/// A line without faults.
#[path = "sim/line.rs"]
mod line;
/// A simulated motor.
#[cfg(feature = "ikeya")]
#[path = "sim/motor.rs"]
mod motor;
/// A master on a simulated bus.
#[cfg(feature = "ikeya")]
#[path = "sim/motor_bus.rs"]
mod motor_bus;
/// Roles with what they move.
#[cfg(all(feature = "ikeya", feature = "ucp"))]
#[path = "sim/nodes.rs"]
mod nodes;
/// A simulated rover.
#[cfg(feature = "ucp")]
#[path = "sim/rover.rs"]
mod rover;
/// An endpoint that sends what a test tells it to.
#[path = "sim/talker.rs"]
mod talker;
/// A wire in real time.
#[path = "sim/wire.rs"]
mod wire;
