//! Drives a rover forward for two seconds and prints its reports: `rover PORT`.
//!
//! After Ctrl-C nothing is sent any more, and the rover stops by itself within half a second.

use std::{env, error::Error, io};

use axlewire::{
    drive::{DriveError, Rover},
    time::Duration,
    ucp::host::COAST,
};

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("which port?")?;
    let mut rover = Rover::open(&path)?;
    let driven = drive(&mut rover);
    // Whatever has happened. An error here means that the rover may be driving: say so.
    rover.stop()?;
    println!("told to stop");
    if rover.role().last_report().is_none() {
        return Err("no robot answers".into());
    }
    rover.await_standstill(COAST)?;
    println!("standing still");
    Ok(driven?)
}

fn drive(rover: &mut Rover) -> Result<(), DriveError<io::Error>> {
    let end = rover.now() + Duration::from_secs(2);
    while rover.now() < end {
        rover.drive(30, 0)?; // percent; counts for half a second
        if let Some(report) = rover.next_report(Duration::from_millis(100))? {
            let seen = report.telemetry;
            println!("{:?} rpm, {:.1} V", seen.rpm, seen.volts());
        }
    }
    Ok(())
}
