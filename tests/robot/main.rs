//! The robot: one scenario per sentence of rulings U6 to U16, in virtual time.
#![cfg(feature = "ucp")]

mod acknowledgements;
mod answers;
mod calibration;
mod commands;
mod counts;
#[path = "../harness/rover_rig.rs"]
#[allow(dead_code, unused_imports, reason = "host uses more of it")]
mod rig;
mod unsent_messages;
