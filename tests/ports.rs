//! Ports of a PC, over pseudo-terminals and in real time. No limit here is tight: a busy machine
//! takes longer, and fails nothing.

#![cfg(all(unix, feature = "ikeya", any(feature = "serialport", feature = "tokio")))]

/// A blocking port.
#[cfg(feature = "serialport")]
#[path = "ports/blocking.rs"]
mod blocking;
/// A motor on the other end of a pseudo-terminal.
#[path = "ports/motor.rs"]
mod motor;
/// A port whose calls are scripted.
#[cfg(feature = "serialport")]
#[path = "ports/scripted.rs"]
mod scripted;
/// An async port.
#[cfg(feature = "tokio")]
#[path = "ports/tokio.rs"]
mod tokio_port;
