//! What is known about the machine: host or microcontroller, the width of its words, and AVX2.
//!
//! The CRC has its two forms in [`crc16`](crate::crc16); everything else that depends on the
//! machine asks here.

/// Is this a host? It has flash to spare, registers of 64 bits or more, and branch prediction.
pub(crate) const IS_HOST: bool = cfg!(target_pointer_width = "64");

/// The contents of one register.
#[cfg(target_pointer_width = "64")]
pub(crate) type Word = u64;
/// The contents of one register.
#[cfg(not(target_pointer_width = "64"))]
pub(crate) type Word = u32;

/// Runs `work`, compiled for AVX2 as far as it is inlined; `None` on a processor without AVX2.
///
/// `pulp` detects the processor once per process. After that, asking is a load and a compare.
#[cfg(all(feature = "simd", target_arch = "x86_64"))]
#[inline(always)]
pub(crate) fn in_avx2<R>(work: impl FnOnce() -> R) -> Option<R> {
    Some(pulp::x86::V3::try_new()?.vectorize(work))
}

/// Always `None`: no AVX2 here.
#[cfg(not(all(feature = "simd", target_arch = "x86_64")))]
#[inline(always)]
pub(crate) fn in_avx2<R>(_work: impl FnOnce() -> R) -> Option<R> {
    None
}
