//! The host's side of the link: settings, events, statistics and the store of biases.
//!
//! [`Host`](crate::ucp::Host) is the role. Its code is in the files of this module, one concept
//! each:
//!
//! | file | what it decides |
//! |---|---|
//! | `role` | commands, and the calls of [`Endpoint`](crate::endpoint::Endpoint) |
//! | `state` | what a received frame means |
//! | `send` | which frame goes next, and what a frame that did not leave means |
//! | `motor` | motor commands, the dead-man and stops (U10, U16) |
//! | `standstill` | whether the robot was seen to obey a stop (U16) |
//! | `ping`, `link` | whether the robot is there (U10, U12) |
//! | `calibration`, `results`, `bias` | calibrations and their results (U11, U15) |
//! | `update` | whether a firmware update was asked for, and until when (U7) |

mod bias;
mod calibration;
mod config;
mod event;
mod link;
mod motor;
mod outgoing;
mod ping;
mod results;
pub(super) mod role;
mod send;
mod standstill;
mod state;
mod statistics;
mod update;

pub use bias::{BiasStore, MemoryStore, NoStore, NotStored};
pub use config::HostConfig;
pub use event::{
    CalibrationFailure, CalibrationStep, CommandError, FailureCause, HostEvent, ReceivedReport,
    UnknownFrame,
};
pub use link::Link;
pub use standstill::{COAST, STILL_REPORTS, StopProgress};
pub use statistics::HostStatistics;
