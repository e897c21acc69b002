//! Start here: `cargo run --example tour`. It needs no hardware and no arguments.
//!
//! Four parts: decoding noisy captures, building packets, a bus of eight motors with a noisy line
//! and a loose plug, and driving a rover.

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
