//! SIMD, turned off.

use core::marker::PhantomData;

use super::{
    framing::{Batch, Framing, Verdict},
    kernel::{Accepted, Kernel, Rejected},
};

/// A framing without SIMD, compiled as without feature `simd`. For measurements and tests.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::{ikeya::ToSlave, stream::{Frames, Portable}};
///
/// let bytes = [0xAA, 0x01, 0xBE, 0xD0].repeat(100);
/// assert_eq!(Frames::<Portable<ToSlave>>::new(&bytes).count(), 100);
/// assert_eq!(Frames::<ToSlave>::new(&bytes).count(), 100);
/// # }
/// ```
#[derive(Debug)]
pub struct Portable<F>(PhantomData<fn() -> F>);

impl<F: Framing> Framing for Portable<F> {
    type Frame<'a> = F::Frame<'a>;
    type Batch = WithoutAvx2<F::Batch>;
    const MIN_LEN: usize = F::MIN_LEN;
    const MAX_LEN: usize = F::MAX_LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        F::judge(bytes)
    }

    #[inline(always)]
    fn view(frame: &[u8]) -> Option<F::Frame<'_>> {
        F::view(frame)
    }
}

/// The batches of another framing, never compiled for AVX2.
#[derive(Debug)]
pub struct WithoutAvx2<K>(PhantomData<fn() -> K>);

impl<K: Kernel> Batch for WithoutAvx2<K> {}

impl<K: Kernel> Kernel for WithoutAvx2<K> {
    const USES_AVX2: bool = false;

    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        K::reject_batch(bytes)
    }

    #[inline(always)]
    fn accept_batch(bytes: &[u8], is_wide: bool) -> Accepted {
        K::accept_batch(bytes, is_wide)
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        K::is_short(bytes)
    }
}
