//! The slave of a motor bus.

#![no_std]
#![no_main]

use axlewire::{
    ikeya::{Mode, NodeId, Slave, slave::SlaveConfig},
    time::Instant,
};
use axlewire_firmware::work::drive;

axlewire_firmware::size_program!(run);

fn run(bytes: &[u8]) -> u32 {
    let now = core::hint::black_box(Instant::from_micros(0));
    let mut role = Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::direct(), now);
    drive(&mut role, bytes, now)
}
