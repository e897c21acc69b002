//! What a protocol defines so that its frames can be found.

use super::{batch::Rejected, ledger::Reason};

/// Verdict on the front of a slice.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// A whole frame with a correct CRC, or whatever else the protocol has.
    Frame {
        /// Length of the frame, bytes.
        len: usize,
    },
    /// The start of a possible frame.
    Partial {
        /// Length, bytes, that the slice must have for `judge` to say more. Greater than its
        /// length now.
        need: usize,
    },
    /// No frame starts at the first byte.
    Reject {
        /// The reason.
        reason: Reason,
        /// Number of following bytes rejected for the same reason, as far as the slice has them. 0
        /// is always right; more saves time in noise.
        more: usize,
    },
}

/// One protocol's rule for finding frames.
///
/// Implement it to find the frames of another protocol with [`Frames`](super::Frames),
/// [`Decoder`](super::Decoder) and [`decode_capture`](super), with the same resync, account and
/// bounds. This example has a sync byte, a length, a payload of 1 to 16 bytes and the sum of all
/// bytes before it:
///
/// ```
/// use axlewire::stream::{Decoder, Event, Frames, Framing, Reason, Verdict};
///
/// /// `7E | len | payload | sum`
/// enum Sensor {}
///
/// impl Framing for Sensor {
///     type Frame<'a> = &'a [u8]; // the payload
///     const MIN_LEN: usize = 4;
///     const MAX_LEN: usize = 19;
///
///     fn judge(bytes: &[u8]) -> Verdict {
///         let reject = |reason| Verdict::Reject { reason, more: 0 };
///         let len = match *bytes {
///             [] => return Verdict::Partial { need: 1 },
///             [0x7E] => return Verdict::Partial { need: 2 },
///             [0x7E, len @ 1..=16, ..] => usize::from(len) + 3,
///             [0x7E, ..] => return reject(Reason::Length),
///             _ => return reject(Reason::Header),
///         };
///         match bytes.get(..len).and_then(|frame| frame.split_last()) {
///             None => Verdict::Partial { need: len },
///             Some((&sum, body)) if body.iter().fold(0, |a: u8, &b| a.wrapping_add(b)) == sum => {
///                 Verdict::Frame { len }
///             }
///             Some(_) => reject(Reason::Crc),
///         }
///     }
///
///     fn view(frame: &[u8]) -> Option<&[u8]> {
///         frame.get(2..frame.len().checked_sub(1)?)
///     }
/// }
///
/// let bytes = [0x00, 0x7E, 2, 10, 20, 0x9E, 0x7E, 1];
/// let mut frames = Frames::<Sensor>::new(&bytes);
/// assert_eq!(frames.next(), Some(&[10, 20][..]));
/// assert_eq!((frames.next(), frames.rest()), (None, &[0x7E, 1][..]));
///
/// let mut decoder = Decoder::<Sensor, 19>::new();
/// let mut input = &bytes[..];
/// assert!(matches!(decoder.decode(&mut input), Some(Event::Skipped(gap)) if gap.len == 1));
/// assert_eq!(decoder.decode(&mut input), Some(Event::Frame(&[10, 20][..])));
/// assert_eq!(decoder.decode(&mut input), None);
/// assert_eq!(decoder.pending(), 2);
/// ```
///
/// A `judge` that breaks its contract causes neither an endless loop nor a panic, and the account
/// still holds. A frame shorter than `MIN_LEN`, and a `Partial` for `MAX_LEN` bytes or more, count
/// as one byte rejected for [`Reason::Header`]. A frame longer than the slice counts as a candidate
/// that the slice cuts off, except in a [`Decoder`](super::Decoder): `decode` may leave it in its
/// input, and `poll` may cut it to the bytes that are held.
pub trait Framing {
    /// The typed view of a frame, borrowed from the bytes it arrived in.
    type Frame<'a>;

    /// Length of the shortest frame, bytes; at least 1. A decoder that holds nothing waits for this
    /// many.
    const MIN_LEN: usize;

    /// Length of the longest frame, bytes. Given this many, `judge` never returns
    /// [`Verdict::Partial`].
    const MAX_LEN: usize;

    /// Judges the front of `bytes` only. An empty slice is `Partial`.
    ///
    /// Appending bytes may turn `Partial` into anything. It changes neither `Frame` nor `Reject`,
    /// except that a `Reject` may cover more bytes.
    fn judge(bytes: &[u8]) -> Verdict;

    /// The view of one whole frame, exactly the bytes that `judge` found to be one.
    ///
    /// `None` for any other bytes, but never after a [`Verdict::Frame`].
    fn view(frame: &[u8]) -> Option<Self::Frame<'_>>;

    /// Number of adjacent frames of the longest length at the front that are cheaper to judge
    /// together than one by one. More may follow.
    ///
    /// Each is either a frame according to `judge` or refused by `view`:
    /// [`Frames::each`](super::Frames::each) passes them on without judging them again, up to the
    /// first without a view. Used on a host only; the framings of this crate have batches.
    #[doc(hidden)]
    #[inline(always)]
    fn accept_batch(bytes: &[u8]) -> usize {
        let _ = bytes;
        0
    }

    /// Rejects bytes at the front that are cheaper to reject together than one by one: `judge`
    /// would reject each of them, for the same reasons.
    ///
    /// Called after a rejected byte, where rejected bytes are dense. Anything may follow the batch,
    /// including more bytes to reject. Used on a host only.
    #[doc(hidden)]
    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        let _ = bytes;
        Rejected::default()
    }
}
