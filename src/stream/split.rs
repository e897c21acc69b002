//! Places at which a capture can be split, so that its parts can be decoded at the same time.

use core::marker::PhantomData;

use super::{
    framing::{Framing, Verdict},
    ledger::Ledger,
    search::{Front, judge, search},
};

/// The first place behind `from` at which `bytes` can be split: decoded apart, the two sides give
/// the events and the counts of the whole. `None` if there is no such place, or if `from` is
/// outside `bytes`.
///
/// It is the end of a frame that begins at `from` or later, at most `bytes.len()`. Bytes that you
/// append to `bytes` later do not change it. In an ordinary capture the first or second frame
/// behind `from` will do; where bytes are damaged or random it may take more.
///
/// To split a capture into parts of equal size, use [`parts`].
///
/// # Why the two sides give the same
///
/// Decoding has no memory but its position, and whether a gap is open: at each position
/// [`Framing::judge`] says whether to go on behind a frame or behind rejected bytes. So all that
/// counts is which positions it visits, and with how many bytes behind them.
///
/// The place returned is the end of a frame whose first byte is *f*, and for each of the
/// `MAX_LEN - 1` positions before *f* the bytes up to the place are enough for a verdict, and this
/// verdict leads no further than *f*. Then:
///
/// * Decoding of the whole visits *f*: it goes from position to position, nothing leads from before
///   *f* to behind it, and what begins earlier than `MAX_LEN - 1` bytes before *f* ends at *f* or
///   before. It takes the frame at *f*, ends there any gap, and goes on at the place, with no gap
///   open: exactly as decoding of the second side begins.
/// * Decoding of the first side alone visits the same positions up to *f*, because none of their
///   verdicts needs bytes from behind the place; more bytes do not change a verdict. It takes the
///   frame at *f*, and nothing is left.
///
/// For a [`Framing`] of your own this holds if a rejection covers fewer than `MAX_LEN` bytes, or
/// only bytes that start no frame.
///
/// # Cost
///
/// At most `MAX_LEN` verdicts for each frame that is tried.
///
/// ```
/// # #[cfg(feature = "ucp")] {
/// use axlewire::{stream, ucp::Ucp};
///
/// let ping = [0xFD, 0xFF, 4, 0, 1, 0, 0x01, 0x42];
/// let bytes = [&[0x00][..], &ping, &ping, &ping].concat();
/// assert_eq!(stream::split_point::<Ucp>(&bytes, 0), Some(9));
/// assert_eq!(stream::split_point::<Ucp>(&bytes, 2), Some(17)); // the first ping has begun at 1
/// assert_eq!(stream::split_point::<Ucp>(&bytes, 20), None);
/// # }
/// ```
#[must_use]
pub fn split_point<F: Framing>(bytes: &[u8], from: usize) -> Option<usize> {
    // The account of this search is of no interest.
    let (mut ledger, mut at) = (Ledger::new(), from);
    loop {
        let (found, front) = search::<F>(bytes.get(at..)?, &mut ledger, Ledger::refuse);
        let frame = bytes.len() - found.len();
        let Front::Frame { len } = front else { return None };
        let end = frame.checked_add(len).filter(|&end| end <= bytes.len())?;
        if is_sure::<F>(bytes.get(..end)?, frame) {
            return Some(end);
        }
        at = end;
    }
}

/// Whether decoding surely visits `frame`, wherever it has begun, without a look behind `bytes`.
fn is_sure<F: Framing>(bytes: &[u8], frame: usize) -> bool {
    let first = frame.saturating_sub(F::MAX_LEN - 1);
    (first..frame).all(|at| {
        let next = match judge::<F>(bytes.get(at..).unwrap_or_default()) {
            Verdict::Frame { len } => at.checked_add(len),
            Verdict::Reject { more, .. } => (at + 1).checked_add(more),
            Verdict::Partial { .. } => None,
        };
        next.is_some_and(|next| next <= frame)
    })
}

/// The parts of a capture, in order, each at least `len` bytes long except the last. Decoded
/// apart, for example by a thread each, they give the events and the counts of the whole.
///
/// Parts end at a [`split_point`]. A capture without such places is one part.
///
/// ```
/// # #[cfg(all(feature = "std", feature = "ikeya"))] {
/// use axlewire::{ikeya::ToMaster, stream::{self, Frames}};
///
/// let capture = [0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E].repeat(1000);
/// let frames: u64 = std::thread::scope(|scope| {
///     let parts = stream::parts::<ToMaster>(&capture, capture.len().div_ceil(2));
///     let threads: Vec<_> = parts
///         .map(|part| scope.spawn(|| {
///             let mut frames = Frames::<ToMaster>::new(part);
///             frames.each(|_response| {});
///             frames.counters().frames
///         }))
///         .collect();
///     threads.into_iter().map(|thread| thread.join().unwrap()).sum()
/// });
/// assert_eq!(frames, 1000);
/// # }
/// ```
#[must_use]
pub fn parts<F: Framing>(bytes: &[u8], len: usize) -> Parts<'_, F> {
    Parts { rest: bytes, len, framing: PhantomData }
}

/// The parts of a capture; see [`parts`].
#[derive(Debug)]
pub struct Parts<'a, F> {
    rest: &'a [u8],
    len: usize,
    framing: PhantomData<fn() -> F>,
}

impl<'a, F: Framing> Iterator for Parts<'a, F> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = split_point::<F>(self.rest, self.len).unwrap_or(self.rest.len());
        let (part, rest) = self.rest.split_at_checked(end)?;
        self.rest = rest;
        Some(part)
    }
}

// By hand: a derive would require `F: Clone`.
impl<F> Clone for Parts<'_, F> {
    fn clone(&self) -> Self {
        Self { framing: PhantomData, ..*self }
    }
}
