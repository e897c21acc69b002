//! The link of a rover: messages, host and robot.

mod host;
mod message;
mod robot;
mod values;

pub use host::*;
pub use message::*;
pub use robot::*;
pub use values::*;
