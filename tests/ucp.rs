//! UCP messages and frames: what is read, what is built, and what is refused.

#![cfg(feature = "ucp")]

/// A frame by hand.
#[path = "ucp/by_hand.rs"]
mod by_hand;
/// Parsing and encoding.
#[path = "ucp/frames.rs"]
mod frames;
/// Ids, bodies and values.
#[path = "ucp/messages.rs"]
mod messages;
/// Range, wheels, and no update by mistake.
#[path = "ucp/motor_commands.rs"]
mod motor_commands;
