//! A motor bus and a rover on a serial port of a PC, in one call.

use core::ops::{Deref, DerefMut};
use std::io;

use super::{Driver, SerialPort, StdClock};
#[cfg(feature = "ikeya")]
use crate::ikeya::{Master, master::MasterConfig};
#[cfg(feature = "ucp")]
use crate::ucp::{
    Host,
    host::{HostConfig, StopProgress},
};

/// A master on a serial port of a PC: a [`Driver`], with all of its calls.
///
/// ```no_run
/// use axlewire::{drive::Bus, ikeya::{NodeId, Rps}, time::Duration};
///
/// let mut bus = Bus::open("/dev/ttyUSB0")?;
/// println!("found: {:?}", bus.discover()?);
/// bus.drive_for(NodeId::N1, Rps::new(2.0)?, Duration::from_secs(3))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # When it is dropped
///
/// It tries to stop, for 100 ms, every node that has a set-point or is owed a stop. **That is no
/// substitute for [`stop`](Driver::stop)**: nobody hears of a stop that is not confirmed, or of a
/// motor that moves on. Nothing is sent if the program is killed, aborts or exits without dropping
/// its values, as Ctrl-C makes it.
#[cfg(feature = "ikeya")]
#[derive(Debug)]
pub struct Bus(Driver<Master, SerialPort, StdClock>);

#[cfg(feature = "ikeya")]
impl Bus {
    /// Opens a port such as `/dev/ttyUSB0` or `COM3`, with [`MasterConfig::usb_adapter`].
    ///
    /// # Errors
    ///
    /// Those of [`SerialPort::open`].
    pub fn open(path: &str) -> io::Result<Self> {
        Self::open_with(path, MasterConfig::usb_adapter())
    }

    /// The same with these settings. On a pseudo-terminal, whose line takes no time,
    /// [`accepts_early`](MasterConfig::accepts_early) is set as well.
    ///
    /// # Errors
    ///
    /// Those of [`SerialPort::open`].
    pub fn open_with(path: &str, config: MasterConfig) -> io::Result<Self> {
        let port = SerialPort::open(path, config.baud)?;
        let mut config = config;
        config.accepts_early |= port.is_pseudo_terminal();
        Ok(Self(Driver::master(config, port, StdClock::new())))
    }
}

#[cfg(feature = "ikeya")]
impl Deref for Bus {
    type Target = Driver<Master, SerialPort, StdClock>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

#[cfg(feature = "ikeya")]
impl DerefMut for Bus {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

#[cfg(feature = "ikeya")]
impl Drop for Bus {
    fn drop(&mut self) {
        self.0.try_stop();
    }
}

/// A host on a serial port of a PC: a [`Driver`], with all of its calls.
///
/// ```no_run
/// use axlewire::{drive::Rover, time::Duration};
///
/// let mut rover = Rover::open("/dev/ttyUSB0")?;
/// println!("round trip: {:?}", rover.ping(Duration::from_secs(1))?);
/// rover.drive_for(30, 0, Duration::from_secs(2))?; // percent ahead, percent of turn
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # When it is dropped
///
/// If the robot was told to move, or a stop has not left, it tries for 100 ms to send a stop.
/// **That is no substitute for [`stop`](Driver::stop)** and `await_standstill`: nobody hears of a
/// stop that has not left, or of a robot that does not obey. Nothing is sent if the program is
/// killed, aborts or exits without dropping its values, as Ctrl-C makes it: then a robot of this
/// crate stops by itself within half a second.
#[cfg(feature = "ucp")]
#[derive(Debug)]
pub struct Rover(Driver<Host, SerialPort, StdClock>);

#[cfg(feature = "ucp")]
impl Rover {
    /// Opens a port such as `/dev/ttyUSB0` or `COM3`, with [`HostConfig::usb_adapter`].
    ///
    /// # Errors
    ///
    /// Those of [`SerialPort::open`].
    pub fn open(path: &str) -> io::Result<Self> {
        Self::open_with(path, HostConfig::usb_adapter())
    }

    /// The same with these settings.
    ///
    /// # Errors
    ///
    /// Those of [`SerialPort::open`].
    pub fn open_with(path: &str, config: HostConfig) -> io::Result<Self> {
        let port = SerialPort::open(path, config.baud)?;
        Ok(Self(Driver::host(config, port, StdClock::new())))
    }
}

#[cfg(feature = "ucp")]
impl Deref for Rover {
    type Target = Driver<Host, SerialPort, StdClock>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

#[cfg(feature = "ucp")]
impl DerefMut for Rover {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

#[cfg(feature = "ucp")]
impl Drop for Rover {
    fn drop(&mut self) {
        let role = self.0.role();
        let has_left = role.is_stop_sent() && role.stop_progress() != StopProgress::Due;
        if role.command().is_some() && !has_left {
            // There is nobody to tell of an error.
            let _ = self.0.stop();
        }
    }
}
