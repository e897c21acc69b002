//! The stream layer: against the slow oracle on hostile streams, and as single scenarios.
#![cfg(all(feature = "ikeya", feature = "ucp", feature = "alloc"))]

mod batches;
mod buffer;
#[path = "../harness/checked_line.rs"]
mod checked_line;
mod crowds;
#[path = "../harness/dice.rs"]
#[allow(dead_code, reason = "a part is enough here")]
mod dice;
mod false_starts;
mod foreign_framings;
#[path = "../harness/hostile_streams.rs"]
mod hostile_streams;
#[path = "../harness/judged_work.rs"]
mod judged_work;
#[path = "../harness/known_framings.rs"]
mod known_framings;
mod noise;
#[path = "../harness/noisy_line.rs"]
mod noisy_line;
#[path = "../harness/oracle.rs"]
mod oracle;
mod properties;
mod quiet_line;
/// Packets for the scenarios, and a decoder's output for them.
mod rig;
mod split;
#[path = "../harness/traffic.rs"]
#[allow(dead_code, reason = "each kind has a test here")]
mod traffic;
