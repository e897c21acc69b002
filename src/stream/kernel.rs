//! Batches: many bytes judged together, for speed on a host.
//!
//! A kernel may only say what [`Framing::judge`](super::Framing::judge) would say of the same
//! bytes. One that judges nothing is right, too: only speed is lost.

/// How a framing judges many bytes at once. Asked on a host only.
///
/// Private: a framing of another crate names [`OneByOne`](super::OneByOne).
pub trait Kernel {
    /// Whether the batches may be compiled for AVX2, where feature `simd` is on.
    const USES_AVX2: bool = true;

    /// Rejects bytes at the front that are cheaper to reject together than one by one: `judge`
    /// would reject each of them, for the same reasons.
    ///
    /// Called behind a rejected byte, where rejected bytes are dense. What follows the batch may be
    /// anything, more bytes to reject included.
    #[inline(always)]
    fn reject_batch(_bytes: &[u8]) -> Rejected {
        Rejected::default()
    }

    /// Accepts frames at the front, one behind the other, that are cheaper to judge together than
    /// one by one. More may follow.
    ///
    /// Each has the shortest or the longest length of its framing, and is a frame by `judge` or
    /// refused by `view`: [`Frames::each`](super::Frames::each) hands them out without judging them
    /// again, up to the first without a view. `is_wide` says that the registers have 256 bits.
    #[inline(always)]
    fn accept_batch(_bytes: &[u8], _is_wide: bool) -> Accepted {
        Accepted::default()
    }

    /// Whether the frame at the front, one of a batch, has the shortest length and not the longest.
    #[inline(always)]
    fn is_short(_bytes: &[u8]) -> bool {
        false
    }
}

/// Bytes at the front that start no frame.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Rejected {
    /// All of them, bytes.
    pub(crate) len: usize,
    /// Of these, rejected for [`Reason::Length`](super::Reason::Length).
    pub(crate) length: usize,
    /// Of these, rejected for [`Reason::Crc`](super::Reason::Crc). The rest is for
    /// [`Reason::Header`](super::Reason::Header).
    pub(crate) crc: usize,
}

/// Frames at the front, one behind the other.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Accepted {
    /// Number of frames.
    pub(crate) frames: usize,
    /// All of them together, bytes.
    pub(crate) len: usize,
}
