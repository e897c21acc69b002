//! Roles and drivers when ports, clocks, switches and applications misbehave: a stop that is said
//! to be paid has reached its motor, and nothing moves on an order that was given up or is too old.
//!
//! The stories are told in virtual time, by drivers on a line with motors of the tests' own. The
//! random campaign plays masters against a model of what the rulings let each node be told.

#![cfg(all(feature = "ikeya", feature = "std", feature = "sim"))]
#![cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "embedded-hal"))]

/// Packets that a port cuts off.
#[path = "adverse/cut_off_packets.rs"]
mod cut_off_packets;
#[path = "models/kit.rs"]
mod kit;
/// Stops and set-points of a master when everything around it misbehaves.
#[path = "adverse/master.rs"]
mod master;
/// Motors of a bus, for the stories.
#[path = "adverse/motor.rs"]
mod motor;
/// Packets that a port takes in parts, with pauses.
#[path = "adverse/paused_packets.rs"]
mod paused_packets;
#[path = "support/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
/// Random masters on random buses, against the rulings.
#[path = "adverse/random_masters.rs"]
mod random_masters;
/// A rover link whose ports fail.
#[cfg(feature = "ucp")]
#[path = "adverse/rover.rs"]
mod rover;
/// What the rulings let a master send.
#[path = "adverse/rulings.rs"]
mod rulings;
/// Slaves that are called late.
#[path = "adverse/slave.rs"]
mod slave;
/// Ports that never get ready.
#[path = "adverse/stalled_ports.rs"]
mod stalled_ports;
/// A line in virtual time.
#[path = "adverse/wire.rs"]
mod wire;
/// Clocks that are wrong once.
#[path = "adverse/wrong_clocks.rs"]
mod wrong_clocks;
