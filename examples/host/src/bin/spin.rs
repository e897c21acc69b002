//! Turns node 1 of a motor bus for three seconds: `spin PORT`.
//!
//! Ctrl-C ends the program at once, and the motor keeps turning; `spin_tokio` stops it first.

use axlewire::drive::Bus;
use axlewire::ikeya::{NodeId, Rps};
use axlewire::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("which port?")?;
    let mut bus = Bus::open(&path)?;
    println!("found: {:?}", bus.discover()?);
    // On an error the motor may still be running.
    bus.drive_for(NodeId::N1, Rps::new(2.0)?, Duration::from_secs(3))?;
    Ok(())
}
