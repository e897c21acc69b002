//! The master, called by hand: one scenario per sentence of rulings I2 and I6 to I13, and what must
//! hold on any line.

#![cfg(all(feature = "ikeya", feature = "sim"))]

mod answer_windows;
mod any_line;
mod blind_stops;
mod boards;
mod dead_man;
mod discovery;
mod health;
mod interrupted_stops;
mod late_failures;
mod modes;
#[path = "../harness/packets.rs"]
mod packets;
mod pulled_cables;
mod rig;
mod schedule;
mod sending_order;
mod sending_order_three_motors;
mod set_points;
mod settings;
mod standstill;
mod stops;
mod stops_of_lost_nodes;
mod three_motors;
mod unsent_frames;
