//! A rover link whose ports fail.

#![cfg(all(feature = "ikeya", feature = "ucp", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

#[path = "harness/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
#[path = "adverse/rover.rs"]
mod rover;
#[path = "drive/motor_line/mod.rs"]
#[allow(dead_code, reason = "the tests of drivers use more of it")]
mod wire;
