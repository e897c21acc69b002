//! Master and slave, called by hand: one story per sentence of rulings I2, I3 and I6 to I14.

#![cfg(feature = "ikeya")]

#[path = "ikeya_roles/commands.rs"]
mod commands;
#[path = "ikeya_roles/dead_man.rs"]
mod dead_man;
#[path = "ikeya_roles/discovery.rs"]
mod discovery;
#[path = "ikeya_roles/health.rs"]
mod health;
#[path = "ikeya_roles/modes.rs"]
mod modes;
#[path = "ikeya_roles/order.rs"]
mod order;
#[path = "ikeya_roles/order_three.rs"]
mod order_three;
#[path = "ikeya_roles/rig.rs"]
mod rig;
#[path = "ikeya_roles/schedule.rs"]
mod schedule;
#[path = "ikeya_roles/settings.rs"]
mod settings;
#[path = "ikeya_roles/slave.rs"]
mod slave;
#[path = "ikeya_roles/standstill.rs"]
mod standstill;
#[path = "ikeya_roles/stops.rs"]
mod stops;
#[path = "ikeya_roles/stops_lost.rs"]
mod stops_lost;
#[path = "ikeya_roles/three.rs"]
mod three;
#[path = "ikeya_roles/unsent.rs"]
mod unsent;
#[path = "ikeya_roles/windows.rs"]
mod windows;
