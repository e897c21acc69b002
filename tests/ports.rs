//! Ports of a PC, over pseudo-terminals and in real time. No limit here is tight: a busy machine
//! takes longer, and fails nothing.

#![cfg(all(unix, feature = "serialport", feature = "ikeya", feature = "sim"))]

/// A blocking port.
#[path = "ports/blocking.rs"]
mod blocking;
/// A motor on the other end of a pseudo-terminal.
#[path = "ports/motor.rs"]
mod motor;
/// A port whose calls are scripted.
#[path = "ports/scripted.rs"]
mod scripted;
