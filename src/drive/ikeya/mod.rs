//! High-level motor-bus calls.

mod calls;
mod steps;

pub use steps::OnlineNodes;
