//! SIMD, turned off.

use core::marker::PhantomData;

use super::{Framing, GoodRun, Swept, Verdict};

/// A framing without its SIMD: what is compiled is what would be without feature `simd`. To measure
/// and to test with.
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
    const MIN_LEN: usize = F::MIN_LEN;
    const MAX_LEN: usize = F::MAX_LEN;
    const SIMD: bool = false;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        F::judge(bytes)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        F::sweep(bytes)
    }

    #[inline(always)]
    fn good_run(bytes: &[u8], wide: bool) -> GoodRun {
        F::good_run(bytes, wide)
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        F::is_short(bytes)
    }

    #[inline(always)]
    fn view(frame: &[u8]) -> Option<F::Frame<'_>> {
        F::view(frame)
    }
}
