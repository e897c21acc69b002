//! Stories of the four roles, on a simulated line: an object of C and a role of Rust stand at the
//! same place, get the same calls, and must do the same: frames, deadlines, events, answers to
//! commands, and all that they tell of themselves.

mod bus;
mod bus_roles;
mod rover;
mod rover_roles;
mod twin;
