//! Roles and drivers when ports, clocks, switches and applications misbehave: a stop that is said
//! to be paid has reached its motor, and nothing moves on an order that was given up or is too old.
//!
//! The stories are told in virtual time, by drivers on a line with motors of the tests' own. The
//! random campaign plays masters against a model of what the rulings let each node be told.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

#[path = "adverse/bus.rs"]
mod bus;
#[path = "adverse/clock.rs"]
mod clock;
#[path = "adverse/cut_off.rs"]
mod cut_off;
#[path = "models/kit.rs"]
mod kit;
#[path = "adverse/model.rs"]
mod model;
#[path = "adverse/motor.rs"]
mod motor;
#[path = "adverse/pauses.rs"]
mod pauses;
#[path = "support/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
#[path = "adverse/random.rs"]
mod random;
#[cfg(feature = "ucp")]
#[path = "adverse/rover.rs"]
mod rover;
#[path = "adverse/slave.rs"]
mod slave;
#[path = "adverse/wire.rs"]
mod wire;
