//! The slave's side of the bus: settings, events, statistics and DIP switches.
//!
//! [`Slave`] is the role.

mod config;
mod dip;
mod event;
mod requests;
mod role;
mod statistics;

pub use config::SlaveConfig;
pub use dip::{DipSwitch, IdReading};
pub use event::SlaveEvent;
pub use role::Slave;
pub use statistics::SlaveStatistics;
