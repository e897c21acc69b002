//! The machine: host or microcontroller, word size.
//!
//! The CRC has its two forms in [`crc16`](crate::crc16); all other code that depends on the machine
//! uses this module.

/// Whether this is a host, with flash to spare, registers of at least 64 bits, and branch
/// prediction.
pub(crate) const IS_HOST: bool = cfg!(target_pointer_width = "64");

/// A register-sized integer.
#[cfg(target_pointer_width = "64")]
pub(crate) type Word = u64;
/// A register-sized integer.
#[cfg(not(target_pointer_width = "64"))]
pub(crate) type Word = u32;
