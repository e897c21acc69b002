//! Finds frames in a byte stream and accounts for every byte.
//!
//! A [`Framing`] knows how one protocol's frames look; [`Frames`] walks a slice that is already in
//! memory, in a loop or, sooner done, with [`each`](Frames::each); [`Decoder`] a stream that arrives in
//! pieces. Both ask the same function what stands at the front of the bytes, so they cannot disagree.
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
//!   `MAX_LEN` times; a host that judges many frames or refuses many bytes together looks a bounded
//!   number of times more often. Nothing allocates, nothing panics.

#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod buffered;
#[cfg(feature = "alloc")]
mod capture;
mod decoder;
mod fill;
mod frames;
mod ledger;
#[cfg(feature = "simd")]
mod portable;
mod run;

#[cfg(feature = "alloc")]
pub use capture::{Located, decode_capture};
pub use decoder::Decoder;
pub use frames::Frames;
pub use ledger::{Counters, Gap, Reason};
#[cfg(feature = "simd")]
pub use portable::Portable;

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
        /// Nor does one, for the same reason, at any of so many bytes behind it, as far as there are
        /// any.
        more: usize,
    },
}

/// What [`Framing::sweep`] has refused.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Swept {
    /// Bytes at the front that start no frame.
    pub len: usize,
    /// How many of them are for [`Reason::Length`].
    pub length: usize,
    /// How many of them are for [`Reason::Crc`]; what remains is for [`Reason::Header`].
    pub crc: usize,
}

/// Good frames at the front, one behind the other, as [`Framing::good_run`] sees them.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct GoodRun {
    /// How many.
    pub frames: usize,
    /// All of them together, bytes.
    pub len: usize,
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

    /// The view of one whole frame, exactly the bytes that `judge` called a frame.
    ///
    /// `None` when they are something else, which never follows a [`Verdict::Frame`].
    fn view(frame: &[u8]) -> Option<Self::Frame<'_>>;

    /// Refuses bytes at the front that are cheaper to refuse together than one by one: `judge` would
    /// refuse each of them, for the same reasons, and may go on to refuse what follows.
    ///
    /// Asked on 64-bit machines where refusals come in crowds, about what lies behind one of them. Only
    /// speed is lost where it always refuses nothing, as by default.
    #[inline(always)]
    fn sweep(_bytes: &[u8]) -> Swept {
        Swept::default()
    }

    /// Which frames stand at the front, one behind the other, as far as it is cheaper to judge them
    /// together than one by one. There may be more.
    ///
    /// All have [`MIN_LEN`](Self::MIN_LEN) or [`MAX_LEN`](Self::MAX_LEN) bytes, and each is one that
    /// `judge` would find there, or one that `view` refuses: [`Frames::each`] hands them out without
    /// judging them again, up to the first that it gets no view of.
    ///
    /// It alone asks, on 64-bit machines; `wide` says that what is compiled has registers of 256 bits, for
    /// which more is cheaper. Only speed is lost where no run is ever seen, as by default.
    #[inline(always)]
    fn good_run(_bytes: &[u8], _wide: bool) -> GoodRun {
        GoodRun::default()
    }

    /// Does the frame at the front, one of a [`good_run`](Self::good_run), have [`MIN_LEN`](Self::MIN_LEN)
    /// bytes? Otherwise it has [`MAX_LEN`](Self::MAX_LEN).
    #[inline(always)]
    fn is_short(_bytes: &[u8]) -> bool {
        false
    }

    /// May `sweep` and `good_run` be compiled for all that the processor can do? With feature `simd`
    /// alone; see `Portable`.
    const SIMD: bool = true;
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
    let mut patience = Patience::new();
    let front = loop {
        match F::judge(rest) {
            Verdict::Frame { len } => break Front::Frame { len },
            Verdict::Partial { need } => break Front::Partial { need },
            Verdict::Reject { reason, more } => {
                let (len, behind) = match rest.get(more..) {
                    Some([_, behind @ ..]) => (1 + more, Some(behind)),
                    // There are not so many bytes.
                    _ => (rest.len(), None),
                };
                refuse(ledger, reason, len);
                let Some(behind) = behind else {
                    rest = &[];
                    break Front::Partial { need: 1 };
                };
                rest = behind;
                if cfg!(target_pointer_width = "64") {
                    rest = patience.sweep::<F>(rest, ledger);
                }
            }
        }
    };
    if rest.len() < bytes.len() {
        ledger.skip(bytes.len() - rest.len());
    }
    (rest, front)
}

/// How many refusals to wait for until bytes are refused together.
///
/// That pays where refusals come in crowds. A damaged frame brings two or three, and the good one
/// behind it is found sooner by looking at one place after the other. Nor does it pay where candidates
/// that have to be looked at stand too close: there it is tried ever more seldom.
struct Patience {
    /// Refusals to wait for yet.
    left: u32,
    /// How many there were to wait for this time.
    begun: u32,
}

impl Patience {
    const fn new() -> Self {
        Self { left: Self::LEAST, begun: Self::LEAST }
    }

    const LEAST: u32 = 6;
    const MOST: u32 = 256;

    /// Counts one refusal, of what stands in front of `bytes`; returns what is left of them.
    #[inline(always)]
    fn sweep<'b, F: Framing>(&mut self, bytes: &'b [u8], ledger: &mut Ledger) -> &'b [u8] {
        self.left -= 1;
        if self.left > 0 {
            return bytes;
        }
        let behind = sweep::<F>(bytes, ledger);
        if bytes.len() - behind.len() > F::MAX_LEN {
            *self = Self::new();
        } else {
            self.begun = (2 * self.begun).min(Self::MOST);
            self.left = self.begun;
        }
        behind
    }
}

/// Books what the framing refuses together, behind a refusal; returns the bytes behind it.
#[cold]
#[inline(never)]
fn sweep<'b, F: Framing>(bytes: &'b [u8], ledger: &mut Ledger) -> &'b [u8] {
    let Swept { len, length, crc } = swept::<F>(bytes);
    let Some(behind) = bytes.get(len..) else { return bytes };
    ledger.refuse(Reason::Length, length);
    ledger.refuse(Reason::Crc, crc);
    behind
}

/// What the framing refuses together; with feature `simd` compiled for all that the processor can do.
#[inline(always)]
fn swept<F: Framing>(bytes: &[u8]) -> Swept {
    #[cfg(feature = "simd")]
    if F::SIMD {
        if let Some(swept) = crate::simd::in_avx2(|| F::sweep(bytes)) {
            return swept;
        }
    }
    F::sweep(bytes)
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
