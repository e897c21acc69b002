//! Finds frames in a byte stream and accounts for every byte.
//!
//! A [`Framing`] knows how one protocol's frames look; [`Frames`] walks a slice that is already in
//! memory, [`Decoder`] a stream that arrives in pieces. Both ask the same function what stands at
//! the front of the bytes, so they cannot disagree.
//!
//! # What holds
//!
//! * **Resync (B2).** A candidate that fails costs exactly one byte and the search goes on inside
//!   it, so a lying length or a false header swallows nothing. Every frame that arrives whole is
//!   delivered unless it overlaps one accepted before it. The price: a whole frame inside the
//!   payload of a *damaged* one is delivered too.
//! * **Account (B2).** `received == framed + skipped + pending`, at any time.
//! * **Bounded stall (B3).** A false header holds good frames back by at most
//!   [`Framing::MAX_LEN`] bytes, and [`Decoder::idle`] ends it when the line goes quiet.
//! * **Reasons (B4).** A gap is one [`Event::Skipped`] with the [`Reason`] of its first byte, and
//!   every skipped byte is counted under its own reason in [`Counters`].
//! * **Chunks do not matter.** Any cutting of the same bytes gives the same events.
//! * **Bounded work.** A byte is looked at once for each candidate it may belong to, at most
//!   `MAX_LEN` times. Nothing allocates, nothing panics.

#[cfg(feature = "alloc")]
mod capture;
mod decoder;
mod frames;
mod ledger;
#[cfg(feature = "simd")]
mod simd;

#[cfg(feature = "alloc")]
pub use capture::{Located, decode_capture};
pub use decoder::Decoder;
pub use frames::Frames;
pub use ledger::{Counters, Gap, Reason};
#[cfg(feature = "simd")]
pub use simd::{GoodRun, Portable, Swept};

use ledger::Ledger;

use crate::error::EncodeError;

/// What stands at the front of a slice.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Verdict {
    /// A whole frame of so many bytes, its CRC right.
    Frame {
        /// Length of the frame, bytes.
        len: usize,
    },
    /// The start of what may be a frame: judging again is useless before so many bytes are there.
    Partial {
        /// Bytes needed, counted from the front; more than the slice has.
        need: usize,
    },
    /// No frame starts at the first byte.
    Reject {
        /// Why not.
        reason: Reason,
        /// Nor does one, for the same reason, at any of so many bytes behind it.
        more: usize,
    },
}

/// One protocol's rule for finding frames.
pub trait Framing {
    /// The typed view of a frame, borrowed from the bytes it arrived in.
    type Frame<'a>;

    /// Shortest frame, bytes, at least 1: where no candidate is known, fewer need not be judged.
    const MIN_LEN: usize;

    /// Longest frame, bytes. Given this many, `judge` never answers [`Verdict::Partial`].
    const MAX_LEN: usize;

    /// Judges the front of `bytes` and nothing else. An empty slice is `Partial`.
    ///
    /// More bytes behind the same ones may turn `Partial` into anything, but change neither
    /// `Frame` nor `Reject`, other than that a `Reject` may cover more bytes.
    fn judge(bytes: &[u8]) -> Verdict;

    /// Does [`good_run`](Self::good_run) ever see one? Without, it is not asked.
    #[cfg(feature = "simd")]
    const HAS_RUNS: bool = false;

    /// Which frames stand at the front, one behind the other, as far as it is cheaper to judge them
    /// together than one by one. Needs feature `simd`.
    ///
    /// All have [`MIN_LEN`](Self::MIN_LEN) or [`MAX_LEN`](Self::MAX_LEN) bytes, and each is one that
    /// `judge` would find there: they are handed out without being judged again. There may be more.
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn good_run(_bytes: &[u8]) -> GoodRun {
        GoodRun::default()
    }

    /// Does the frame at the front, one of a [`good_run`](Self::good_run), have [`MIN_LEN`](Self::MIN_LEN)
    /// bytes? Otherwise it has [`MAX_LEN`](Self::MAX_LEN). Needs feature `simd`.
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn is_short(_bytes: &[u8]) -> bool {
        false
    }

    /// How many bytes of a gap are refused one by one before [`sweep`](Self::sweep) is asked: behind a
    /// damaged frame the next one is near. `usize::MAX`: it never is.
    #[cfg(feature = "simd")]
    const SWEEPS_BEHIND: usize = usize::MAX;

    /// Refuses bytes at the front, as far as it is cheaper to refuse them together than one by one.
    /// Needs feature `simd`.
    ///
    /// Each of them is what `judge` would refuse there, one byte after the other; never a packet that
    /// is skipped whole. What stands behind them may be anything.
    #[cfg(feature = "simd")]
    #[inline(always)]
    fn sweep(_bytes: &[u8]) -> Swept {
        Swept::default()
    }

    /// The view of one whole frame, exactly the bytes that `judge` called a frame.
    ///
    /// `None` when they are something else, which never follows a [`Verdict::Frame`].
    fn view(frame: &[u8]) -> Option<Self::Frame<'_>>;
}

/// What a stream brings: frames, and the gaps between them.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event<T> {
    /// A whole frame, its CRC right.
    Frame(T),
    /// A gap, reported when it has ended: by a frame, or by a quiet line.
    Skipped(Gap),
}

/// A verdict that is no refusal: what the search stops at.
#[derive(Clone, Copy, Debug)]
enum Front {
    Frame { len: usize },
    Partial { need: usize },
}

/// Books refusals from the front of `bytes` until something else stands there; returns the bytes
/// from there on and what it is.
///
/// On a host, good frames do not wait for the registers that refusals need: those have a function
/// of their own. A microcontroller has no flash for it, and its caller says how to book them.
#[inline(always)]
fn search<'b, F: Framing>(
    bytes: &'b [u8],
    ledger: &mut Ledger,
    refuse: impl Fn(&mut Ledger, Reason, usize),
) -> (&'b [u8], Front) {
    if cfg!(target_pointer_width = "64") {
        match F::judge(bytes) {
            Verdict::Frame { len } => (bytes, Front::Frame { len }),
            Verdict::Partial { need } => (bytes, Front::Partial { need }),
            Verdict::Reject { .. } => search_on::<F>(bytes, ledger),
        }
    } else {
        search_through::<F>(bytes, ledger, refuse)
    }
}

#[cold]
#[inline(never)]
fn search_on<'b, F: Framing>(bytes: &'b [u8], ledger: &mut Ledger) -> (&'b [u8], Front) {
    search_through::<F>(bytes, ledger, Ledger::refuse)
}

#[inline(always)]
fn search_through<'b, F: Framing>(
    bytes: &'b [u8],
    ledger: &mut Ledger,
    refuse: impl Fn(&mut Ledger, Reason, usize),
) -> (&'b [u8], Front) {
    let mut rest = bytes;
    let front = loop {
        match F::judge(rest) {
            Verdict::Frame { len } => break Front::Frame { len },
            Verdict::Partial { need } => break Front::Partial { need },
            Verdict::Reject { reason, more } => {
                let len = 1 + more;
                refuse(ledger, reason, len);
                let Some(behind) = rest.get(len..) else {
                    rest = &[];
                    break Front::Partial { need: 1 };
                };
                rest = behind;
                #[cfg(feature = "simd")]
                if bytes.len() - rest.len() > F::SWEEPS_BEHIND {
                    rest = ledger.sweep(F::sweep(rest), rest);
                }
            }
        }
    };
    if rest.len() < bytes.len() {
        ledger.skip(bytes.len() - rest.len());
    }
    (rest, front)
}

/// A whole frame that can be sent: it knows its bytes, CRC included.
pub trait Encode {
    /// Length of the frame, bytes.
    fn encoded_len(&self) -> usize;

    /// Writes the frame to the front of `buffer` and returns just those bytes.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] when it does not fit, and what the type itself refuses;
    /// `buffer` is then as it was.
    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError>;
}

/// Copies a frame that lies ready to the front of `buffer`.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub(crate) fn encode_bytes<'b>(
    frame: &[u8],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let available = buffer.len();
    let target = buffer
        .get_mut(..frame.len())
        .ok_or(EncodeError::BufferTooSmall { needed: frame.len(), available })?;
    target.copy_from_slice(frame);
    Ok(target)
}
