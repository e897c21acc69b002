//! A line with faults, in virtual time, and models of the devices on it: for tests of applications
//! and of this crate.
//!
//! [`Line`] drives roles exactly as [`Endpoint`](crate::endpoint::Endpoint) describes, byte by
//! byte, with the [`Faults`] and the slow or chunky [`Timing`]s that you set. One simulated second
//! takes milliseconds, and the same seed gives the same second. An endpoint that would make a real
//! driver spin is an error, [`Stuck`].
//!
//! `Motor` and `Rover` are models without a line, for tests that have their own. `MotorNode` and
//! `RoverNode` combine them with the slave or the robot that drives them. [`Wire`] is a line with
//! the same faults for simulations in real time.
//!
//! ```
//! # #[cfg(feature = "ikeya")] {
//! use axlewire::ikeya::{master::{Health, MasterConfig}, Master, Mode, NodeId};
//! use axlewire::sim::{Direction, Faults, Line, MotorNode};
//! use axlewire::time::{Duration, Instant};
//!
//! let start = Instant::from_micros(0); // a line begins at 0
//! let mut master = Master::new(MasterConfig::direct(), start);
//! master.discover(start);
//! let mut line = Line::new(500_000, 42, master);
//! for node in [NodeId::N1, NodeId::N2] {
//!     line.add(MotorNode::new(node, Mode::Position));
//! }
//! *line.pair_mut(Direction::ToHead) = Faults::noise(1e-3); // one bit in 1000 is wrong
//! line.run_for(Duration::from_secs(1))?;
//! assert_ne!(line.head().health(NodeId::N2), None);
//! assert!(line.statistics(Direction::ToHead).bit_errors > 0);
//! # }
//! # Ok::<(), axlewire::sim::Stuck>(())
//! ```

mod arrivals;
mod faults;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod lag;
mod line;
#[cfg(feature = "ikeya")]
mod motor;
#[cfg(feature = "ikeya")]
mod motor_node;
mod port;
mod rng;
#[cfg(feature = "ucp")]
mod rover;
#[cfg(feature = "ucp")]
mod rover_node;
mod wire;

pub use faults::{Faults, PairStatistics};
pub use line::{Direction, Line, Stuck, Traced, Who};
#[cfg(feature = "ikeya")]
pub use motor::Motor;
#[cfg(feature = "ikeya")]
pub use motor_node::{MotorBoard, MotorNode};
pub use port::{Input, Timing};
pub use rng::Rng;
#[cfg(feature = "ucp")]
pub use rover::Rover;
#[cfg(feature = "ucp")]
pub use rover_node::RoverNode;
pub use wire::Wire;
