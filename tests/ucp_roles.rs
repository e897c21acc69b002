//! Host and robot: one story per sentence of rulings U6 to U16, in virtual time.
//!
//! The two talk over a line in memory that takes 10 bit times per byte and does what a test wants
//! with the frames. After every step the rig asks both roles for their next deadline: it must lie
//! ahead, or a driver would spin.
#![cfg(feature = "ucp")]

#[path = "ucp_roles/both.rs"]
mod both;
#[path = "ucp_roles/calibration.rs"]
mod calibration;
#[path = "ucp_roles/hang.rs"]
mod hang;
#[path = "ucp_roles/kept.rs"]
mod kept;
#[path = "ucp_roles/kept_properties.rs"]
mod kept_properties;
#[path = "ucp_roles/link.rs"]
mod link;
#[path = "ucp_roles/motion.rs"]
mod motion;
#[path = "ucp_roles/motion_properties.rs"]
mod motion_properties;
#[path = "ucp_roles/properties.rs"]
mod properties;
#[path = "ucp_roles/rig.rs"]
mod rig;
#[path = "ucp_roles/robot.rs"]
mod robot;
#[path = "ucp_roles/unsent.rs"]
mod unsent;
#[path = "ucp_roles/update.rs"]
mod update;
