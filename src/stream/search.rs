//! The search for the next frame, and when to judge batches.

use super::{
    batch::Rejected,
    framing::{Framing, Verdict},
    ledger::{Ledger, Reason},
};
use crate::machine::IS_HOST;

/// What stops the search: a verdict other than a rejection.
#[derive(Clone, Copy, Debug)]
pub(super) enum Front {
    Frame { len: usize },
    Partial { need: usize },
}

/// Judges the front of `bytes`. A verdict that would make the search endless becomes the rejection
/// of one byte: a frame shorter than the shortest, or a candidate that asks for more than the
/// longest frame. An empty slice is always `Partial`. The compiler sees that none of this happens
/// with the framings of this crate.
///
/// A frame longer than `bytes` passes: the caller notices when it splits the frame off.
#[inline(always)]
pub(super) fn judge<F: Framing>(bytes: &[u8]) -> Verdict {
    const { assert!(1 <= F::MIN_LEN && F::MIN_LEN <= F::MAX_LEN, "1 <= MIN_LEN <= MAX_LEN") }
    match F::judge(bytes) {
        Verdict::Frame { len } if len >= F::MIN_LEN && !bytes.is_empty() => Verdict::Frame { len },
        Verdict::Partial { need } if bytes.len() < F::MAX_LEN => {
            Verdict::Partial { need: need.max(bytes.len() + 1).min(F::MAX_LEN) }
        }
        Verdict::Reject { reason, more } if !bytes.is_empty() => Verdict::Reject { reason, more },
        _ if bytes.is_empty() => Verdict::Partial { need: 1 },
        _ => Verdict::Reject { reason: Reason::Header, more: 0 },
    }
}

/// Books rejected bytes at the front of `bytes` up to the first that is not rejected. Returns the
/// bytes from there on, and what they start with.
///
/// On a host, rejections have a function of their own, so that their registers do not slow down
/// good frames. A microcontroller lacks the flash for that, and the caller chooses how to book
/// rejections.
#[inline(always)]
pub(super) fn search<'b, F: Framing>(
    bytes: &'b [u8],
    ledger: &mut Ledger,
    refuse: impl Fn(&mut Ledger, Reason, usize),
) -> (&'b [u8], Front) {
    if IS_HOST {
        match judge::<F>(bytes) {
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
    let mut back_off = BackOff::new();
    let front = loop {
        match judge::<F>(rest) {
            Verdict::Frame { len } if len <= rest.len() => break Front::Frame { len },
            Verdict::Frame { len: need } | Verdict::Partial { need } => {
                break Front::Partial { need };
            }
            Verdict::Reject { reason, more } => {
                let (len, behind) = match rest.get(more..) {
                    Some([_, behind @ ..]) => (1 + more, Some(behind)),
                    // The slice ends within the rejected bytes.
                    _ => (rest.len(), None),
                };
                refuse(ledger, reason, len);
                let Some(behind) = behind else {
                    rest = &[];
                    break Front::Partial { need: 1 };
                };
                rest = behind;
                if IS_HOST {
                    rest = back_off.reject_batch::<F>(rest, ledger);
                }
            }
        }
    };
    if rest.len() < bytes.len() {
        ledger.skip(bytes.len() - rest.len());
    }
    (rest, front)
}

/// Number of rejections to wait for before bytes are rejected in batches.
///
/// Batches pay where rejected bytes are dense. A damaged frame brings two or three rejections, and
/// the good frame after it is found faster one byte at a time. Batches do not pay either where
/// candidates that have to be judged are close together: there the attempts back off.
struct BackOff {
    /// Rejections still to wait for.
    left: u32,
    /// Rejections to wait for in this round.
    begun: u32,
}

impl BackOff {
    const LEAST: u32 = 6;
    const MOST: u32 = 256;

    const fn new() -> Self {
        Self { left: Self::LEAST, begun: Self::LEAST }
    }

    /// Counts one rejection, of bytes in front of `bytes`; returns the bytes still to be judged.
    #[inline(always)]
    fn reject_batch<'b, F: Framing>(&mut self, bytes: &'b [u8], ledger: &mut Ledger) -> &'b [u8] {
        self.left -= 1;
        if self.left > 0 {
            return bytes;
        }
        let behind = reject_batch::<F>(bytes, ledger);
        if bytes.len() - behind.len() > F::MAX_LEN {
            *self = Self::new();
        } else {
            self.begun = (2 * self.begun).min(Self::MOST);
            self.left = self.begun;
        }
        behind
    }
}

/// Books the bytes that a batch rejects; returns the bytes after it.
#[cold]
#[inline(never)]
fn reject_batch<'b, F: Framing>(bytes: &'b [u8], ledger: &mut Ledger) -> &'b [u8] {
    let Rejected { len, length, crc } = F::reject_batch(bytes);
    let Some(behind) = bytes.get(len..) else { return bytes };
    ledger.refuse(Reason::Length, length);
    ledger.refuse(Reason::Crc, crc);
    behind
}

/// When to look for a batch of frames.
///
/// The end of a batch is a mispredicted branch, and a failed look is wasted work. So the looks back
/// off where damage is dense, or where frames do not have the lengths of a batch.
#[derive(Debug)]
pub(super) struct Looks {
    /// Number of remaining bytes at which the next look is due.
    due: usize,
    /// Distance from a look that did not pay to the next one, bytes.
    wait: usize,
}

/// Number of frames that makes a look pay: nearly the most that Ikeya's batches can have.
const MANY: usize = 14;

/// Two packets.
const FIRST_WAIT: usize = 16;

/// Longest wait, bytes: what good frames lose at most when they return.
const LONGEST_WAIT: usize = 1 << 14;

impl Looks {
    pub(super) const fn new() -> Self {
        Self { due: usize::MAX, wait: 0 }
    }

    /// Number of frames of the longest length in the batch at the front of `rest`; 0 if no look is
    /// due, or it finds none.
    #[inline(always)]
    pub(super) fn accept_batch<F: Framing>(&mut self, rest: &[u8]) -> usize {
        if !IS_HOST || rest.len() > self.due {
            return 0;
        }
        let frames = F::accept_batch(rest).min(rest.len() / F::MAX_LEN);
        self.wait = if frames >= MANY {
            self.wait / 4
        } else {
            (4 * self.wait).clamp(FIRST_WAIT, LONGEST_WAIT)
        };
        self.due = (rest.len() - frames * F::MAX_LEN).saturating_sub(self.wait);
        frames
    }
}
