//! What must hold before a motor is connected: nothing moves without a command, and everything that
//! is told to stop does stop.
//!
//! A test marked `Fails today` asserts the correct behaviour and expects the message of its own
//! assertion. Once the crate is correct, the mark and `should_panic` go.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

/// The host of a rover.
#[cfg(feature = "ucp")]
#[path = "motion/host.rs"]
mod host;
/// The master.
#[path = "motion/master.rs"]
mod master;
#[path = "harness/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
/// The robot.
#[cfg(feature = "ucp")]
#[path = "motion/robot.rs"]
mod robot;
#[cfg(feature = "ucp")]
#[path = "harness/rover_rig.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "host and robot use more of it")]
mod rover_rig;
/// The slave.
#[path = "motion/slave.rs"]
mod slave;
/// The master of three-motor boards.
#[path = "motion/three_motors.rs"]
mod three_motors;
