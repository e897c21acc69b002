//! Host and robot: one story per sentence of rulings U6 to U16, in virtual time.
//!
//! The two talk over a line in memory that takes 10 bit times per byte and does what a test wants
//! with the frames. After every step the rig asks both roles for their next deadline: it must lie
//! ahead, or a driver would spin.
#![cfg(feature = "ucp")]

#[path = "ucp_roles/acknowledgement_properties.rs"]
mod acknowledgement_properties;
#[path = "ucp_roles/acknowledgements.rs"]
mod acknowledgements;
#[path = "ucp_roles/calibration.rs"]
mod calibration;
#[path = "ucp_roles/firmware_hangs.rs"]
mod firmware_hangs;
#[path = "ucp_roles/firmware_update.rs"]
mod firmware_update;
#[path = "ucp_roles/host_and_robot.rs"]
mod host_and_robot;
#[path = "ucp_roles/link.rs"]
mod link;
#[path = "ucp_roles/motor_commands.rs"]
mod motor_commands;
#[path = "ucp_roles/rig.rs"]
mod rig;
#[path = "ucp_roles/robot.rs"]
mod robot;
#[path = "ucp_roles/robustness.rs"]
mod robustness;
#[path = "ucp_roles/standstill_properties.rs"]
mod standstill_properties;
#[path = "ucp_roles/unsent_messages.rs"]
mod unsent_messages;
#[path = "ucp_roles/unsent_motor_commands.rs"]
mod unsent_motor_commands;
