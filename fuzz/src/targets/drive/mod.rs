//! Drivers, blocking and async, with ports that fail, deliver little, accept little and stall:
//! every call ends, its work is bounded, no frame is cut into another, and `Ok` is true.

mod bus;
mod bus_peer;
mod link;
mod link_peer;
mod rig;

pub(super) use bus::bus;
pub(super) use link::link;

use super::{Tally, fault, oracle, port};
