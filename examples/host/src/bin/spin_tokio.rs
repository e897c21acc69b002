//! Turns node 1 of a motor bus for three seconds, or until Ctrl-C: `spin_tokio PORT`.

use std::{env, error::Error};

use axlewire::{
    drive::{TokioClock, TokioSerialPort, asynch::Driver},
    ikeya::{BAUD, NodeId, Rps, master::MasterConfig},
    time::Duration,
};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("which port?")?;
    let port = TokioSerialPort::open(&path, BAUD)?;
    let mut config = MasterConfig::usb_adapter();
    config.nodes = NodeId::N1.into(); // the whole bus
    config.accepts_early = port.is_pseudo_terminal(); // a simulated line takes no time
    let mut bus = Driver::master(config, port, TokioClock::new());
    println!("found: {:?}", bus.discover().await?);
    let turned = tokio::select! {
        turned = bus.drive_for(NodeId::N1, Rps::new(2.0)?, Duration::from_secs(3)) => turned,
        signal = tokio::signal::ctrl_c() => Ok(signal?),
    };
    // A turn that was dropped leaves its stop to this call.
    bus.stop_all().await?; // an error here means that the motor may be running: say so
    println!("stopped");
    Ok(turned?)
}
