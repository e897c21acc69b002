//! Roles and drivers with misbehaving ports, clocks, switches and applications: a stop reported as
//! paid has reached its motor, and nothing moves on a withdrawn or outdated order.
//!
//! The scenarios run in virtual time, with drivers on a line of simulated motors. The random
//! campaign runs masters against a model of what the rulings allow.

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
/// Motors of a bus, for the scenarios.
#[path = "adverse/motor.rs"]
mod motor;
/// Ports that take a packet in parts, with pauses.
#[path = "adverse/paused_packets.rs"]
mod paused_packets;
#[path = "harness/port.rs"]
#[allow(dead_code, reason = "io.rs uses more of it")]
mod port;
/// Random masters on random buses, against the rulings.
#[path = "adverse/random_masters.rs"]
mod random_masters;
/// A rover link whose ports fail.
#[cfg(feature = "ucp")]
#[path = "adverse/rover.rs"]
mod rover;
/// What the rulings allow a master to send.
#[path = "adverse/rulings.rs"]
mod rulings;
/// Slaves that are called late.
#[path = "adverse/slave.rs"]
mod slave;
/// Ports that never become ready.
#[path = "adverse/stalled_ports.rs"]
mod stalled_ports;
/// A line in virtual time.
#[path = "adverse/wire.rs"]
mod wire;
/// Clocks with one wrong reading.
#[path = "adverse/wrong_clocks.rs"]
mod wrong_clocks;
