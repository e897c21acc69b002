//! Many places judged at once, on a host: what a framing may say of them, and what is made of that.

use core::marker::PhantomData;

use super::{Framing, Verdict};

/// Frames that [`Framing::look_ahead`] sees: bit `n` stands for the place `n` bytes behind the front.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Ahead {
    /// Where a frame of [`Framing::MAX_LEN`] bytes begins.
    pub long: u64,
    /// Where a frame of [`Framing::MIN_LEN`] bytes begins.
    pub short: u64,
}

/// What [`Framing::sweep`] has refused.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Swept {
    /// Bytes at the front that start no frame.
    pub len: usize,
    /// How many of them are for [`Reason::Length`](super::Reason::Length).
    pub length: usize,
    /// How many are for [`Reason::Crc`](super::Reason::Crc); all others are for
    /// [`Reason::Header`](super::Reason::Header).
    pub crc: usize,
}

/// A framing without its SIMD: what is compiled is what would be without feature `simd`. To measure
/// and to test with.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::{ikeya::ToSlave, stream::{Frames, Portable}};
///
/// let bytes = [0xAA, 0x01, 0xBE, 0xD0].repeat(100);
/// assert!(Frames::<Portable<ToSlave>>::new(&bytes).eq(Frames::<ToSlave>::new(&bytes)));
/// # }
/// ```
#[derive(Debug)]
pub struct Portable<F>(PhantomData<fn() -> F>);

impl<F: Framing> Framing for Portable<F> {
    type Frame<'a> = F::Frame<'a>;
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

/// Frames known to be good that have not been handed out, and when to look for more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lookout {
    ahead: Ahead,
    /// Frames to judge one by one before looking ahead is worth a try.
    wait: u32,
}

/// A look is worth its price where it shows so many frames.
const WORTH: u32 = 3;

/// After one that was not, so many frames are judged one by one.
const WAIT: u32 = 8;

impl Lookout {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { ahead: Ahead::default(), wait: 0 }
    }

    /// The length of the frame at the front of `rest`, if it is known to be one.
    #[inline(always)]
    pub(super) fn next<F: Framing>(&mut self, rest: &[u8]) -> Option<usize> {
        if !F::LOOKS_AHEAD {
            return None;
        }
        if let Some(len) = self.take::<F>() {
            return Some(len);
        }
        if self.wait > 0 {
            self.wait -= 1;
            return None;
        }
        self.ahead = F::look_ahead(rest);
        if (self.ahead.long | self.ahead.short).count_ones() < WORTH {
            self.wait = WAIT;
        }
        self.take::<F>()
    }

    #[inline(always)]
    fn take<F: Framing>(&mut self) -> Option<usize> {
        let len = if self.ahead.long & 1 == 1 {
            F::MAX_LEN
        } else if self.ahead.short & 1 == 1 {
            F::MIN_LEN
        } else {
            return None;
        };
        let shifted = |places: u64| u32::try_from(len).ok().and_then(|len| places.checked_shr(len));
        self.ahead.long = shifted(self.ahead.long).unwrap_or(0);
        self.ahead.short = shifted(self.ahead.short).unwrap_or(0);
        Some(len)
    }
}
