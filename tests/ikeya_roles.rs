//! Master and slave, called by hand: one story per sentence of rulings I2, I3 and I6 to I14.

#![cfg(feature = "ikeya")]

#[path = "ikeya_roles/answer_windows.rs"]
mod answer_windows;
#[path = "ikeya_roles/dead_man.rs"]
mod dead_man;
#[path = "ikeya_roles/discovery.rs"]
mod discovery;
#[path = "ikeya_roles/health.rs"]
mod health;
#[path = "ikeya_roles/modes.rs"]
mod modes;
#[path = "ikeya_roles/rig.rs"]
mod rig;
#[path = "ikeya_roles/schedule.rs"]
mod schedule;
#[path = "ikeya_roles/sending_order.rs"]
mod sending_order;
#[path = "ikeya_roles/sending_order_three_motors.rs"]
mod sending_order_three_motors;
#[path = "ikeya_roles/set_points.rs"]
mod set_points;
#[path = "ikeya_roles/settings.rs"]
mod settings;
#[path = "ikeya_roles/slave.rs"]
mod slave;
#[path = "ikeya_roles/standstill.rs"]
mod standstill;
#[path = "ikeya_roles/stops.rs"]
mod stops;
#[path = "ikeya_roles/stops_of_lost_nodes.rs"]
mod stops_of_lost_nodes;
#[path = "ikeya_roles/three_motors.rs"]
mod three_motors;
#[path = "ikeya_roles/unsent_frames.rs"]
mod unsent_frames;
