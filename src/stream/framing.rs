//! What a protocol has to say so that its frames can be found.

use super::{kernel::Kernel, ledger::Reason};

/// What the front of a slice is.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// A whole frame with the right CRC.
    Frame {
        /// Length of the frame, bytes.
        len: usize,
    },
    /// The start of what may become a frame.
    Partial {
        /// Bytes needed, counted from the front, before calling `judge` again can say more. Greater
        /// than the length of the slice.
        need: usize,
    },
    /// No frame starts at the first byte.
    Reject {
        /// Why not.
        reason: Reason,
        /// Number of following bytes rejected for the same reason, as far as the slice has them.
        more: usize,
    },
}

/// One protocol's rule for finding frames.
///
/// Implement it to have [`Frames`](super::Frames), [`Decoder`](super::Decoder) and
/// [`decode_capture`](super) find the frames of another protocol, with the same resync, the same
/// account and the same bounds. Here is one with a sync byte, a length, a payload of 1 to 16 bytes
/// and a sum over everything in front of it:
///
/// ```
/// use axlewire::stream::{Decoder, Event, Frames, Framing, OneByOne, Reason, Verdict};
///
/// /// `7E | len | payload | sum`
/// enum Sensor {}
///
/// impl Framing for Sensor {
///     type Frame<'a> = &'a [u8]; // the payload
///     type Batch = OneByOne;
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
/// A `judge` that breaks its contract can neither make these loop nor panic, and the account holds. A
/// frame shorter than `MIN_LEN`, and a `Partial` about `MAX_LEN` bytes or more, count as one byte
/// rejected for [`Reason::Header`]; at a frame longer than the slice, a `Decoder` stops taking input.
pub trait Framing {
    /// The typed view of a frame, borrowed from the bytes it arrived in.
    type Frame<'a>;

    /// How many bytes are judged at once on a host: [`OneByOne`] for every framing of another crate.
    type Batch: Batch;

    /// Shortest frame, bytes; at least 1. A decoder that holds nothing waits for this many.
    const MIN_LEN: usize;

    /// Longest frame, bytes. Given this many, `judge` never answers [`Verdict::Partial`].
    const MAX_LEN: usize;

    /// Judges the front of `bytes` and nothing else. An empty slice is `Partial`.
    ///
    /// More bytes behind the same ones may turn `Partial` into anything, but change neither
    /// `Frame` nor `Reject`, except that a `Reject` may cover more bytes.
    fn judge(bytes: &[u8]) -> Verdict;

    /// The view of one whole frame, exactly the bytes that `judge` called a frame.
    ///
    /// `None` for any other bytes, never after a [`Verdict::Frame`].
    fn view(frame: &[u8]) -> Option<Self::Frame<'_>>;
}

/// How a [`Framing`] judges many bytes at once, where a host gains by it.
///
/// It has no methods to implement: the framings of this crate have batches of their own, and every
/// other framing names [`OneByOne`].
pub trait Batch: Kernel {}

/// No batches: one byte after the other, one frame after the other. The same frames and gaps.
#[derive(Clone, Copy, Debug)]
pub enum OneByOne {}

impl Kernel for OneByOne {}
impl Batch for OneByOne {}
