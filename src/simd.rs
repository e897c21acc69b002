//! AVX2 where the processor has it, without `unsafe` of ours.

/// Runs `work`, compiled for AVX2 as far as it is inlined; `None` on a processor without.
///
/// Which processor it is, `pulp` finds out once per process; after that, asking is a load and a compare.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(crate) fn in_avx2<R>(work: impl FnOnce() -> R) -> Option<R> {
    Some(pulp::x86::V3::try_new()?.vectorize(work))
}

/// There is none.
#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn in_avx2<R>(_work: impl FnOnce() -> R) -> Option<R> {
    None
}
