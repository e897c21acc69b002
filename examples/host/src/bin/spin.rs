//! Turns node 1 of a motor bus for three seconds: `spin PORT`.
//!
//! Ctrl-C ends the program at once, and the motor keeps turning; `spin_tokio` stops it first.

use axlewire::drive::{Driver, SerialPort, StdClock};
use axlewire::ikeya::{BAUD, Master, NodeId, Rps, master::MasterConfig};
use axlewire::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("which port?")?;
    let port = SerialPort::open(&path, BAUD)?;
    let mut config = MasterConfig::usb_adapter();
    config.nodes = NodeId::N1.into(); // the whole bus
    config.accepts_early = port.is_pseudo_terminal(); // a simulated line takes no time
    let mut bus = Driver::with(|now| Master::new(config, now), port, StdClock::new());
    println!("found: {:?}", bus.discover()?);
    let turned = bus.drive_for(NodeId::N1, Rps::new(2.0)?, Duration::from_secs(3));
    bus.stop_all()?; // an error here means that the motor may be running: say so
    Ok(turned?)
}
