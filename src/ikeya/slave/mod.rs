//! The slave's side of the bus: settings, events, statistics and DIP switches.
//!
//! [`Slave`](crate::ikeya::Slave) is the role.

mod config;
mod dip;
mod event;
mod requests;
pub(super) mod role;
mod statistics;

pub use config::SlaveConfig;
pub use dip::{DipSwitch, IdReading};
pub use event::SlaveEvent;
pub use statistics::SlaveStatistics;
