//! UCP messages and frames: what is parsed, what is built, and what is refused.

#![cfg(feature = "ucp")]

/// A hand-made frame.
#[path = "ucp/by_hand.rs"]
mod by_hand;
/// Parsing and encoding.
#[path = "ucp/frames.rs"]
mod frames;
/// Ids, bodies and values.
#[path = "ucp/messages.rs"]
mod messages;
/// Range, wheels, and no accidental update.
#[path = "ucp/motor_commands.rs"]
mod motor_commands;
