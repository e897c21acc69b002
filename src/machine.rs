//! The machine: host or microcontroller, word size, AVX2.
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

/// Runs `work` with everything inlined into it compiled for AVX2; `None` if the processor has no
/// AVX2.
///
/// `pulp` detects the processor once per process. After that, the check is a load and a compare.
#[cfg(all(feature = "simd", target_arch = "x86_64"))]
#[inline(always)]
pub(crate) fn in_avx2<R>(work: impl FnOnce() -> R) -> Option<R> {
    Some(pulp::x86::V3::try_new()?.vectorize(work))
}

/// Always `None`: no AVX2 in this build.
#[cfg(not(all(feature = "simd", target_arch = "x86_64")))]
#[inline(always)]
pub(crate) fn in_avx2<R>(_work: impl FnOnce() -> R) -> Option<R> {
    None
}
