//! High-level rover calls.

mod calls;
mod steps;
