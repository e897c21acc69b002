//! Packets, messages and values: what is parsed, built and refused, as bytes, text and data.

mod captures;
mod crc16;
#[path = "../harness/dice.rs"]
#[allow(dead_code, reason = "only bytes are random here")]
mod dice;
mod ikeya;
mod layout;
mod motor_commands;
mod printing;
/// Packets made by hand.
mod rig;
mod time;
mod ucp_frames;
mod ucp_messages;
mod vectors;
mod vocabulary;
