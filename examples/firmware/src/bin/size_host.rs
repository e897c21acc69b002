//! The host of a rover, without a store for biases.

#![no_std]
#![no_main]

use axlewire::{
    time::Instant,
    ucp::{Host, host::HostConfig},
};
use axlewire_firmware::work::drive;

axlewire_firmware::size_program!(run);

fn run(bytes: &[u8]) -> u32 {
    let now = core::hint::black_box(Instant::from_micros(0));
    let mut role = Host::new(HostConfig::default(), now);
    drive(&mut role, bytes, now)
}
