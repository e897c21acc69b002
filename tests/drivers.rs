//! Drivers over ports that fail, end, stall and stutter, in virtual time: nothing is lost, nothing
//! hangs, every error says what it is.

#![cfg(all(feature = "ikeya", feature = "ucp", feature = "std"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

#[path = "drivers/bus.rs"]
mod bus;
#[path = "drivers/contract.rs"]
mod contract;
#[path = "drivers/direction.rs"]
mod direction;
#[path = "drivers/rover.rs"]
mod rover;
#[path = "drivers/script.rs"]
mod script;
#[path = "support/world.rs"]
mod world;
