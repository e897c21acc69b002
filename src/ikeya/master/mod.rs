//! The master's side of the bus: settings, events, node health and statistics.
//!
//! [`Master`](super::Master) is the role. Its code is in the files of this module, one concept
//! each:
//!
//! | file | what it owns |
//! |---|---|
//! | `role` | commands, and the calls of [`Endpoint`](crate::endpoint::Endpoint); the dead-man (I13) |
//! | `line` | what is on the wire: the reply window, what the port holds (I7) |
//! | `queue` | which packet goes next: rounds, the search, discovery (I13) |
//! | `node` | whether a node answers, when it is asked, and which request is due (I7, I8) |
//! | `order` | what a node has been told, and the stop that it is owed (I6, I8, I12) |
//! | `mode` | the mode on record, and whether it is in doubt (I11) |
//! | `replies` | what an answer or a silence changes, and what the application is told |
//! | `view` | what an application can query |

mod config;
mod event;
mod line;
mod mode;
mod node;
mod order;
mod queue;
mod replies;
pub(super) mod role;
mod statistics;
mod view;

pub use super::{node_set::NodeSet, schedule::Schedule};
pub use config::{MasterConfig, Polling};
pub use event::{Cause, CommandError, Health, MasterEvent};
pub use order::StopProgress;
pub use statistics::{MasterStatistics, NodeStatistics};
