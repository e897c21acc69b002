//! Host and robot: one scenario per sentence of rulings U6 to U16, in virtual time.
//!
//! The two talk over a line in memory that takes 10 bit times per byte and handles frames as the
//! test requires. After every step the rig asks both roles for their next deadline: it must be in
//! the future, or a driver would spin.
#![cfg(feature = "ucp")]

/// Properties: nothing acknowledged is lost.
#[path = "ucp_roles/acknowledgement_properties.rs"]
mod acknowledgement_properties;
/// What is acknowledged, and when.
#[path = "ucp_roles/acknowledgements.rs"]
mod acknowledgements;
/// The end of an update, and indices.
#[path = "ucp_roles/after_an_update.rs"]
mod after_an_update;
/// Calibrations and biases.
#[path = "ucp_roles/calibration.rs"]
mod calibration;
/// What is counted, and how often.
#[path = "ucp_roles/counts.rs"]
mod counts;
/// Both kinds, each time, to the microsecond.
#[path = "ucp_roles/edges.rs"]
mod edges;
/// Ids on which some firmware hangs.
#[path = "ucp_roles/firmware_hangs.rs"]
mod firmware_hangs;
/// Firmware updates.
#[path = "ucp_roles/firmware_update.rs"]
mod firmware_update;
/// Properties common to host and robot.
#[path = "ucp_roles/host_and_robot.rs"]
mod host_and_robot;
/// The link, pings and reports.
#[path = "ucp_roles/link.rs"]
mod link;
/// Motor commands and the dead-man.
#[path = "ucp_roles/motor_commands.rs"]
mod motor_commands;
/// Frames that have become wrong, and kinds that do not fit.
#[path = "ucp_roles/outdated_frames.rs"]
mod outdated_frames;
/// Helpers: roles alone, and two roles on one line.
#[path = "ucp_roles/rig.rs"]
mod rig;
/// The robot.
#[path = "ucp_roles/robot.rs"]
mod robot;
/// Properties: any calls, bytes and times.
#[path = "ucp_roles/robustness.rs"]
mod robustness;
/// Presets and shortest times.
#[path = "ucp_roles/settings.rs"]
mod settings;
/// Properties: everything that should be stopped is.
#[path = "ucp_roles/standstill_properties.rs"]
mod standstill_properties;
/// Other messages that did not reach the line.
#[path = "ucp_roles/unsent_messages.rs"]
mod unsent_messages;
/// Motor commands that did not reach the line.
#[path = "ucp_roles/unsent_motor_commands.rs"]
mod unsent_motor_commands;
