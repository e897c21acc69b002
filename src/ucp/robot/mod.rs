//! The robot's side of the link: settings, events and statistics.
//!
//! [`Robot`](crate::ucp::Robot) is the role. Its code is in the files of this module, one concept
//! each:
//!
//! | file | what it decides |
//! |---|---|
//! | `role` | commands, and the calls of [`Endpoint`](crate::endpoint::Endpoint) |
//! | `state` | what a received frame means, and when the watchdog fires (U10) |
//! | `send` | which frame goes next, and what a frame that did not leave means |
//! | `repeat` | periodic frames: reports, results, requests for biases |

mod config;
mod event;
mod outgoing;
mod repeat;
pub(super) mod role;
mod send;
mod state;
mod statistics;

pub use config::{ReportLayout, RobotConfig};
pub use event::{RobotEvent, UpdateSource};
pub use statistics::RobotStatistics;
