//! The slave, called by hand: one scenario per sentence of rulings I2, I3, I9, I10 and I14.

#![cfg(feature = "ikeya")]

#[path = "../harness/packets.rs"]
mod packets;
mod rig;
mod role;
mod three_motors;
mod times;
