//! The master's side of the bus: settings, events, node health and statistics.
//!
//! [`Master`] is the role. Its code is in the files of this module, one concept each:
//!
//! | file | what it decides |
//! |---|---|
//! | `role` | commands, and the calls of [`Endpoint`](crate::endpoint::Endpoint) |
//! | `queue`, `turns` | which packet goes next (I13) |
//! | `window`, `replies` | which replies are accepted, and what they do (I7) |
//! | `echo` | which received bytes are the master's own |
//! | `strikes`, `health` | when a node is abnormal, and how it is searched for (I7) |
//! | `discovery` | which ids are polled for the first time |
//! | `mode` | whether a node has changed its mode (I11) |
//! | `stop`, `set_point` | what a node is owed, and what it has been told (I12) |
//! | `dead_man` | when a silent application has its nodes stopped (I13) |
//! | `view` | what an application can query |

mod config;
mod dead_man;
mod discovery;
mod echo;
mod event;
mod health;
mod mode;
mod node;
mod nodes;
mod queue;
mod replies;
mod role;
mod schedule;
mod set_point;
mod statistics;
mod stop;
mod strikes;
mod turns;
mod view;
mod window;

pub use config::{MasterConfig, Polling};
pub use event::{Cause, CommandError, MasterEvent};
pub use health::Health;
pub use nodes::NodeSet;
pub use role::Master;
pub use schedule::Schedule;
pub use statistics::{MasterStatistics, NodeStatistics};
pub use stop::StopProgress;
