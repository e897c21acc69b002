//! The first thing to run: `cargo run --example tour`. No hardware, no arguments.
//!
//! Four acts: captures decoded with the noise in them, packets built, a bus of eight motors with a
//! noisy line and a loose plug, and a drive with a rover.

mod bus;
mod rover;
mod wire;

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    wire::decode_captures();
    wire::build_packets()?;
    bus::run()?;
    rover::run()
}

pub(crate) fn title(text: &str) {
    println!("\n{text}\n{}\n", "─".repeat(text.chars().count()));
}
