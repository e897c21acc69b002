//! The master of a motor bus.

#![no_std]
#![no_main]

use axlewire::{
    ikeya::{Master, master::MasterConfig},
    time::Instant,
};
use axlewire_firmware::work::drive;

axlewire_firmware::size_program!(run);

fn run(bytes: &[u8]) -> u32 {
    let now = core::hint::black_box(Instant::from_micros(0));
    let mut role = Master::new(MasterConfig::direct(), now);
    role.discover(now);
    drive(&mut role, bytes, now)
}
