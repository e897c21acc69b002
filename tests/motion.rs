//! What must hold before a motor is connected: nothing moves without a command, and everything that
//! is told to stop does stop.
//!
//! A test marked `Fails today` asserts the correct behaviour and expects the message of its own
//! assertion. Once the crate is correct, the mark and `should_panic` go.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

/// The master.
#[path = "motion/master.rs"]
mod master;
/// The slave.
#[path = "motion/slave.rs"]
mod slave;
/// The master of three-motor boards.
#[path = "motion/three_motors.rs"]
mod three_motors;
