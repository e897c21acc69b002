//! Text without an allocation: numbers, hex digits, and lines of both.
//!
//! Packets are printed by the hundred thousand, and core's formatting machinery costs more than
//! the numbers themselves. The writers here give the same text as core, which tests prove for each;
//! only floats go through core.

#[cfg(any(feature = "serde", feature = "ucp"))]
mod hex;
mod line;
#[cfg(all(test, feature = "std"))]
mod tests;

#[cfg(any(feature = "serde", feature = "ucp"))]
pub(crate) use hex::Hex;
pub(crate) use line::Line;
