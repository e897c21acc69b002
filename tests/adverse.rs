//! Roles and drivers when ports, clocks, switches and applications misbehave: a stop that is said
//! to be paid has reached its motor, and nothing moves on an order that was given up or is too old.
//!
//! The stories are told in virtual time, by drivers on a line with motors of the tests' own. The
//! random campaign plays masters against a model of what the rulings let each node be told.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

#[path = "adverse/cut_off_packets.rs"]
mod cut_off_packets;
#[path = "models/kit.rs"]
mod kit;
#[path = "adverse/master.rs"]
mod master;
#[path = "adverse/motor.rs"]
mod motor;
#[path = "adverse/paused_packets.rs"]
mod paused_packets;
#[path = "support/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
#[path = "adverse/random_masters.rs"]
mod random_masters;
#[cfg(feature = "ucp")]
#[path = "adverse/rover.rs"]
mod rover;
#[path = "adverse/rulings.rs"]
mod rulings;
#[path = "adverse/slave.rs"]
mod slave;
#[path = "adverse/stalled_ports.rs"]
mod stalled_ports;
#[path = "adverse/wire.rs"]
mod wire;
#[path = "adverse/wrong_clocks.rs"]
mod wrong_clocks;
