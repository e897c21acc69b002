//! The robot side of a rover.

#![no_std]
#![no_main]

use axlewire::{
    time::Instant,
    ucp::{Robot, robot::RobotConfig},
};
use axlewire_firmware::work::drive;

axlewire_firmware::size_program!(run);

fn run(bytes: &[u8]) -> u32 {
    let now = core::hint::black_box(Instant::from_micros(0));
    let mut role = Robot::new(RobotConfig::default(), now);
    drive(&mut role, bytes, now)
}
