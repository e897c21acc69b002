//! The simulated line and its stations: what it does to bytes, to time and to roles.
#![cfg(feature = "sim")]

mod drivers;
mod exact;
mod faults;
mod line;
#[cfg(feature = "ikeya")]
mod motor;
#[cfg(feature = "ikeya")]
mod motor_bus;
#[cfg(all(feature = "ikeya", feature = "ucp"))]
mod nodes;
#[cfg(feature = "ucp")]
mod rover;
mod talker;
mod wire;
