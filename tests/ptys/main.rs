//! Ports of a PC and the clock of `std`, over pseudo-terminals and in real time. No limit here is
//! tight: a busy machine takes longer, and fails nothing.

#![cfg(all(unix, feature = "ikeya", any(feature = "serialport", feature = "tokio")))]

#[cfg(feature = "serialport")]
#[path = "../harness/tty.rs"]
#[allow(dead_code, reason = "drive uses more of it")]
mod tty;

mod motor;

#[cfg(feature = "serialport")]
mod blocking;
mod clock;
#[cfg(feature = "serialport")]
mod signals;
#[cfg(feature = "tokio")]
mod tokio_port;
