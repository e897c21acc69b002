//! The stream layer: against the slow oracle on hostile streams, and as single scenarios.
#![cfg(all(feature = "ikeya", feature = "ucp", feature = "simd"))]

/// The buffer of a decoder.
#[path = "stream/buffer.rs"]
mod buffer;
#[path = "harness/checked_line.rs"]
mod checked_line;
/// False headers, damage and nested frames.
#[path = "stream/false_starts.rs"]
mod false_starts;
/// Framings from outside this crate.
#[path = "stream/foreign_framings.rs"]
mod foreign_framings;
#[path = "harness/hostile_streams.rs"]
mod hostile_streams;
#[path = "harness/judged_work.rs"]
mod judged_work;
#[path = "harness/known_framings.rs"]
mod known_framings;
#[path = "harness/oracle.rs"]
mod oracle;
/// Properties of every framing.
#[path = "stream/properties.rs"]
mod properties;
/// Delay and silence.
#[path = "stream/quiet_line.rs"]
mod quiet_line;
/// Packets for the scenarios, and a decoder's output for them.
#[path = "stream/rig.rs"]
mod rig;
/// Decoding a capture in parts.
#[path = "stream/split.rs"]
mod split;
/// How often a candidate is judged.
#[path = "stream/work.rs"]
mod work;
