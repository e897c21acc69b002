//! The host: one scenario per sentence of rulings U6 to U16, in virtual time.
#![cfg(feature = "ucp")]

mod acknowledgements;
mod calibration;
mod counts;
mod firmware_hangs;
mod firmware_update;
mod link;
mod motor_commands;
#[path = "../harness/rover_rig.rs"]
#[allow(dead_code, unused_imports, reason = "robot uses more of it")]
mod rig;
mod settings;
mod stop_progress;
mod unsent_messages;
mod unsent_motor_commands;
mod with_a_robot;
