//! Master and slave, called by hand: one scenario per sentence of rulings I2, I3 and I6 to I14.

#![cfg(feature = "ikeya")]

/// Which packet counts as an answer.
#[path = "ikeya_roles/answer_windows.rs"]
mod answer_windows;
/// An application that goes silent.
#[path = "ikeya_roles/dead_man.rs"]
mod dead_man;
/// Finding the nodes of a bus.
#[path = "ikeya_roles/discovery.rs"]
mod discovery;
/// Echoes of packets that did not fit or did not leave.
#[path = "ikeya_roles/echo.rs"]
mod echo;
/// Strikes, and the search for abnormal nodes.
#[path = "ikeya_roles/health.rs"]
mod health;
/// Stops that are interrupted.
#[path = "ikeya_roles/interrupted_stops.rs"]
mod interrupted_stops;
/// Failures that come late, and set-points that keep changing.
#[path = "ikeya_roles/late_failures.rs"]
mod late_failures;
/// Modes in doubt and modes that change.
#[path = "ikeya_roles/modes.rs"]
mod modes;
/// A master called by hand.
#[path = "ikeya_roles/rig.rs"]
mod rig;
/// The cycle rate of a bus.
#[path = "ikeya_roles/schedule.rs"]
mod schedule;
/// Sending order and longest waits.
#[path = "ikeya_roles/sending_order.rs"]
mod sending_order;
/// The same for boards with three motors.
#[path = "ikeya_roles/sending_order_three_motors.rs"]
mod sending_order_three_motors;
/// Set-points and their confirmation.
#[path = "ikeya_roles/set_points.rs"]
mod set_points;
/// Settings of a master.
#[path = "ikeya_roles/settings.rs"]
mod settings;
/// The slave.
#[path = "ikeya_roles/slave.rs"]
mod slave;
/// Times of a slave.
#[path = "ikeya_roles/slave_times.rs"]
mod slave_times;
/// Measured standstill.
#[path = "ikeya_roles/standstill.rs"]
mod standstill;
/// Stops of nodes that answer.
#[path = "ikeya_roles/stops.rs"]
mod stops;
/// Stops of nodes that do not answer.
#[path = "ikeya_roles/stops_of_lost_nodes.rs"]
mod stops_of_lost_nodes;
/// Slaves with three motors.
#[path = "ikeya_roles/three_motor_slaves.rs"]
mod three_motor_slaves;
/// Boards with three motors.
#[path = "ikeya_roles/three_motors.rs"]
mod three_motors;
/// Frames that did not reach the line.
#[path = "ikeya_roles/unsent_frames.rs"]
mod unsent_frames;
