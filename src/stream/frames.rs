//! Iteration over the frames of a slice.

use core::marker::PhantomData;

use super::{
    framing::{Framing, Verdict},
    ledger::{Counters, Ledger},
    search::{Front, Looks, judge, search},
};

/// The frames of a slice that is already in memory, borrowed from it.
///
/// The iterator stops at the end of the slice, or at a candidate that this end cuts off:
/// [`rest`](Self::rest) is then that tail; keep it until more bytes arrive. If nothing will follow,
/// call [`idle`](Self::idle) to search on inside it.
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
    framing: PhantomData<fn() -> F>,
}

impl<'a, F: Framing> Frames<'a, F> {
    /// The frames of `bytes`.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, ledger: Ledger::new(), framing: PhantomData }
    }

    /// The bytes not judged yet. Once the iterator has ended, the candidate that the end of the
    /// slice cuts off, shorter than [`Framing::MAX_LEN`].
    #[must_use]
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Refuses the candidate that the end of the slice cuts off, if there is one, so that the
    /// search can go on inside it: nothing follows (ruling B3).
    ///
    /// Call it when the iterator has ended, and iterate again, until [`rest`](Self::rest) is empty.
    // Rare: keep it out of the loop that takes the frames.
    #[inline(never)]
    pub fn idle(&mut self) {
        let [_, rest @ ..] = self.rest else { return };
        let is_cut_off = match judge::<F>(self.rest) {
            Verdict::Partial { .. } => true,
            // Only if the framing breaks its contract.
            Verdict::Frame { len } => len > self.rest.len(),
            Verdict::Reject { .. } => false,
        };
        if is_cut_off {
            self.ledger.refuse_idle();
            self.rest = rest;
        }
    }

    /// Passes every remaining frame to `take`: the frames of [`next`](Self::next), in the same
    /// order. The iterator has then ended.
    ///
    /// Faster than a `for` loop where frames of one length follow each other, as on a motor bus:
    /// many of them are judged together.
    /// The iterator's own methods for all frames, such as [`fold`](Iterator::fold),
    /// [`for_each`](Iterator::for_each) and [`count`](Iterator::count), are as fast, but consume
    /// the iterator and so its [`counters`](Self::counters).
    ///
    /// ```
    /// # #[cfg(feature = "ikeya")] {
    /// use axlewire::{ikeya, stream::Frames};
    ///
    /// // The answers of node 2, at 1.0 rps, as they lie in a capture.
    /// let bytes = [0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E].repeat(1000);
    /// let mut sum = 0.0;
    /// let mut frames = Frames::<ikeya::ToMaster>::new(&bytes);
    /// frames.each(|response| {
    ///     if let ikeya::Response::Velocity(velocity) = response {
    ///         sum += velocity.rps();
    ///     }
    /// });
    /// assert_eq!((sum, frames.counters().frames), (1000.0, 1000));
    /// # }
    /// ```
    #[inline]
    pub fn each(&mut self, mut take: impl FnMut(F::Frame<'a>)) {
        self.fold_rest((), |(), frame| take(frame));
    }

    #[inline]
    fn fold_rest<B>(&mut self, init: B, mut fold: impl FnMut(B, F::Frame<'a>) -> B) -> B {
        let (mut folded, mut looks) = (init, Looks::new());
        loop {
            loop {
                let frames = looks.accept_batch::<F>(self.rest);
                if frames == 0 {
                    break;
                }
                folded = self.fold_batch(frames, folded, &mut fold);
            }
            match self.next() {
                Some(frame) => folded = fold(folded, frame),
                None => return folded,
            }
        }
    }

    /// Passes the frames of a batch to `fold`, and books them.
    #[inline(always)]
    fn fold_batch<B>(
        &mut self,
        frames: usize,
        init: B,
        fold: &mut impl FnMut(B, F::Frame<'a>) -> B,
    ) -> B {
        let (mut folded, mut taken) = (init, 0);
        for frame in self.rest.chunks_exact(F::MAX_LEN).take(frames) {
            let Some(frame) = F::view(frame) else { break };
            folded = fold(folded, frame);
            taken += 1;
        }
        if taken > 0 {
            let len = taken * F::MAX_LEN;
            self.ledger.frames(taken, len);
            self.rest = self.rest.get(len..).unwrap_or_default();
        }
        folded
    }

    /// The account of every byte so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.ledger.counters(self.rest.len())
    }
}

// By hand: a derive would require `F: Clone`.
impl<F> Clone for Frames<'_, F> {
    fn clone(&self) -> Self {
        Self { ledger: self.ledger.clone(), ..*self }
    }
}

impl<'a, F: Framing> Iterator for Frames<'a, F> {
    type Item = F::Frame<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<F::Frame<'a>> {
        let (found, front) = search::<F>(self.rest, &mut self.ledger, Ledger::refuse);
        let Front::Frame { len } = front else {
            self.rest = found;
            return None;
        };
        let (frame, rest) = found.split_at_checked(len)?;
        self.rest = rest;
        self.ledger.end_gap();
        self.ledger.frame(len);
        F::view(frame)
    }

    #[inline]
    fn fold<B, G: FnMut(B, F::Frame<'a>) -> B>(mut self, init: B, fold: G) -> B {
        self.fold_rest(init, fold)
    }
}
