//! Frames of a slice.

use core::marker::PhantomData;

#[cfg(not(feature = "simd"))]
use super::search;
use super::{Counters, Framing, Front, Verdict, ledger::Ledger};
#[cfg(feature = "simd")]
use super::{GoodRun, run::Run};

/// Frames of a slice that is already in memory, borrowed from it.
///
/// The iterator stops where the slice ends, or where a candidate begins that the slice cuts off:
/// [`rest`](Self::rest) is then that tail, to be kept until more has arrived. When nothing more
/// will come, [`idle`](Self::idle) lets the search go on inside it.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::{ikeya, stream::Frames};
///
/// // A stray byte, node 2 at 1.0 rps, and the start of another response.
/// let bytes = [0x00, 0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E, 0x55, 0x03];
/// let mut frames = Frames::<ikeya::ToMaster>::new(&bytes);
/// let Some(ikeya::Response::Velocity(response)) = frames.next() else { panic!() };
/// assert_eq!((response.id(), response.rps()), (ikeya::NodeId::N2, 1.0));
/// assert!(frames.next().is_none());
/// assert_eq!(frames.rest(), [0x55, 0x03]);
/// assert_eq!(frames.counters().header, 1);
/// # }
/// ```
#[derive(Debug)]
pub struct Frames<'a, F> {
    rest: &'a [u8],
    ledger: Ledger,
    #[cfg(feature = "simd")]
    run: Run,
    framing: PhantomData<fn() -> F>,
}

impl<'a, F: Framing> Frames<'a, F> {
    /// Frames of `bytes`, from the first byte on.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            ledger: Ledger::new(),
            #[cfg(feature = "simd")]
            run: Run::new(),
            framing: PhantomData,
        }
    }

    /// What has not been judged yet; once the iterator has ended, the candidate that the slice
    /// cuts off, shorter than [`Framing::MAX_LEN`].
    #[must_use]
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Nothing follows the slice: refuses the candidate that it cuts off, if there is one, so that
    /// the search can go on inside it (ruling B3).
    ///
    /// Call it once the iterator has ended, as often as [`rest`](Self::rest) is not empty.
    // Rare: not to be compiled into the loop that takes the frames.
    #[inline(never)]
    pub fn idle(&mut self) {
        if let (Verdict::Partial { .. }, [_, rest @ ..]) = (F::judge(self.rest), self.rest) {
            self.ledger.refuse_idle();
            self.rest = rest;
        }
    }

    /// A frame of so many bytes that is booked.
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn take(&mut self, len: usize) -> Option<F::Frame<'a>> {
        let (frame, rest) = self.rest.split_at_checked(len)?;
        self.rest = rest;
        F::view(frame)
    }

    /// Where every byte went so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let counters = self.ledger.counters(self.rest.len());
        #[cfg(feature = "simd")]
        let counters = {
            let GoodRun { frames, len, .. } = self.run.unclaimed::<F>(self.rest);
            Counters {
                received: counters.received.wrapping_sub(len as u64),
                framed: counters.framed.wrapping_sub(len as u64),
                frames: counters.frames.wrapping_sub(frames as u64),
                ..counters
            }
        };
        counters
    }
}

/// Whatever `F` is: there is none of it in here.
impl<F> Clone for Frames<'_, F> {
    fn clone(&self) -> Self {
        Self { ledger: self.ledger.clone(), ..*self }
    }
}

impl<'a, F: Framing> Iterator for Frames<'a, F> {
    type Item = F::Frame<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<F::Frame<'a>> {
        #[cfg(feature = "simd")]
        if self.run.goes_on::<F>(self.rest) {
            // A branch: a length that is looked up would have to be waited for.
            return if F::is_short(self.rest) {
                self.take(F::MIN_LEN)
            } else {
                self.take(F::MAX_LEN)
            };
        }
        #[cfg(feature = "simd")]
        let (found, front) = self.run.search::<F>(self.rest, &mut self.ledger);
        #[cfg(not(feature = "simd"))]
        let (found, front) = search::<F>(self.rest, &mut self.ledger, Ledger::refuse);
        let Front::Frame { len } = front else {
            self.rest = found;
            return None;
        };
        let (frame, rest) = found.split_at_checked(len)?;
        self.rest = rest;
        self.ledger.frame(len);
        F::view(frame)
    }
}
