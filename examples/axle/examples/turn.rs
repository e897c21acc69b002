//! Turns node 1 of a motor bus for three seconds: `cargo run -p axle --example turn -- PORT`.

use std::{env, error::Error, io, time};

use axlewire::{
    drive::{DriveError, Driver, StdClock},
    ikeya::{Master, NodeId, Rps, master::MasterConfig},
    time::Duration,
};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use serialport::SerialPort;

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("which port?")?;
    let tty = serialport::new(path, 500_000).timeout(time::Duration::from_millis(100)).open()?;
    turn(Port(tty))?;
    Ok(())
}

fn turn<P: Read + Write + ReadReady>(port: P) -> Result<(), DriveError<P::Error>> {
    let mut config = MasterConfig::usb_adapter();
    config.nodes = [NodeId::N1].into_iter().collect(); // the whole bus
    config.accepts_early = true; // a simulated line takes no time; not on a real one
    let mut bus = Driver::with(|now| <Master>::new(config, now), port, StdClock::new());
    for (node, mode) in bus.discover()? {
        println!("node {node} is in {mode} mode");
    }
    let speed = Rps::from_rpm(120.0).unwrap_or(Rps::ZERO);
    let turned = bus.drive_for(NodeId::N1, speed, Duration::from_millis(3000));
    // Ok only once the node has confirmed its stop. Otherwise the motor may be running: say so.
    bus.stop_all()?;
    turned
}

/// A serial port of this machine behind the traits that the driver asks for.
struct Port(Box<dyn SerialPort>);

impl ErrorType for Port {
    type Error = io::Error;
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        io::Read::read(&mut self.0, buffer)
    }
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> io::Result<bool> {
        Ok(self.0.bytes_to_read()? > 0)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        io::Write::write(&mut self.0, bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        io::Write::flush(&mut self.0)
    }
}
