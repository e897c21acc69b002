//! Where every byte went: counters, reasons, gaps.

use core::fmt;

/// Why bytes were skipped (ruling B4).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum Reason {
    /// No frame starts with this byte.
    Header,
    /// The length field has a value that no frame has.
    Length,
    /// A whole packet with a good CRC for a node that cannot exist (ruling I1).
    Id,
    /// The CRC does not belong to the bytes in front of it.
    Crc,
    /// The line went quiet in the middle of the candidate (ruling B3).
    Idle,
}

impl Reason {
    /// The reason in one lower-case word: `header`, `length`, `id`, `crc` or `idle`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Length => "length",
            Self::Id => "id",
            Self::Crc => "crc",
            Self::Idle => "idle",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A run of bytes that belong to no frame.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gap {
    /// Length, bytes; at least 1.
    pub len: u64,
    /// Why its first byte was skipped.
    pub reason: Reason,
}

/// Where every byte went, `received == framed + skipped() + pending`. All counts wrap at 2^64,
/// which no line reaches.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Counters {
    /// Bytes taken in.
    pub received: u64,
    /// Bytes that belong to delivered frames.
    pub framed: u64,
    /// Frames delivered.
    pub frames: u64,
    /// Gaps begun.
    pub gaps: u64,
    /// Bytes that start no frame.
    pub header: u64,
    /// Candidates with an impossible length, one byte each.
    pub length: u64,
    /// Bytes of whole packets for nodes that cannot exist.
    pub id: u64,
    /// Candidates with a wrong CRC, one byte each.
    pub crc: u64,
    /// Candidates cut off by a quiet line, one byte each.
    pub idle: u64,
}

impl Counters {
    /// Bytes that belong to no frame, for whatever reason.
    #[must_use]
    pub const fn skipped(&self) -> u64 {
        self.header
            .wrapping_add(self.length)
            .wrapping_add(self.id)
            .wrapping_add(self.crc)
            .wrapping_add(self.idle)
    }

    /// Bytes skipped for this reason.
    #[must_use]
    pub const fn skipped_for(&self, reason: Reason) -> u64 {
        match reason {
            Reason::Header => self.header,
            Reason::Length => self.length,
            Reason::Id => self.id,
            Reason::Crc => self.crc,
            Reason::Idle => self.idle,
        }
    }
}

/// The one place where bytes are booked.
///
/// Only what cannot be told from the rest is counted: a frame costs two additions, a byte that
/// starts no frame none of its own.
#[derive(Clone, Debug)]
pub(super) struct Ledger {
    framed: u64,
    /// Bytes in all gaps; those that no other count claims are [`Reason::Header`].
    skipped: u64,
    length: u64,
    id: u64,
    crc: u64,
    idle: u64,
    /// Not beside `framed`: on a host the compiler would count both in one register of 128 bits, and
    /// each frame would wait for the store of the one before.
    frames: u64,
    gaps: u64,
    /// Why the gap that is open began.
    gap: Option<Reason>,
    /// `skipped` as it was then.
    gap_start: u64,
}

impl Ledger {
    pub(super) const fn new() -> Self {
        Self {
            framed: 0,
            frames: 0,
            skipped: 0,
            length: 0,
            id: 0,
            crc: 0,
            idle: 0,
            gaps: 0,
            gap: None,
            gap_start: 0,
        }
    }

    /// A frame of `len` bytes, where no gap is open: it has been taken, or ended without a report.
    #[inline(always)]
    pub(super) fn frame(&mut self, len: usize) {
        self.frames(1, len);
    }

    /// The same for so many frames of so many bytes together.
    #[inline(always)]
    pub(super) fn frames(&mut self, frames: usize, len: usize) {
        self.framed = self.framed.wrapping_add(len as u64);
        self.frames = self.frames.wrapping_add(frames as u64);
    }

    /// So many bytes are refused for this reason; `skip` counts them.
    ///
    /// Every count gets a number, most of them zero: on a microcontroller the compiler then leaves
    /// out those that nobody reads.
    #[inline(always)]
    pub(super) fn refuse(&mut self, reason: Reason, len: usize) {
        if self.gap.is_none() {
            (self.gap, self.gap_start) = (Some(reason), self.skipped);
            self.gaps = self.gaps.wrapping_add(1);
        }
        let if_for = |wanted: Reason| if reason == wanted { len as u64 } else { 0 };
        self.length = self.length.wrapping_add(if_for(Reason::Length));
        self.id = self.id.wrapping_add(if_for(Reason::Id));
        self.crc = self.crc.wrapping_add(if_for(Reason::Crc));
        self.idle = self.idle.wrapping_add(if_for(Reason::Idle));
    }

    /// `refuse` for callers whose counts are read by somebody: out of their way, and there once.
    #[inline(never)]
    pub(super) fn refuse_apart(&mut self, reason: Reason, len: usize) {
        self.refuse(reason, len);
    }

    /// The first byte of a candidate that a quiet line cuts off.
    pub(super) fn refuse_idle(&mut self) {
        self.refuse(Reason::Idle, 1);
        self.skip(1);
    }

    /// So many bytes have been refused.
    #[inline(always)]
    pub(super) fn skip(&mut self, len: usize) {
        self.skipped = self.skipped.wrapping_add(len as u64);
    }

    /// Is there a gap that is to be reported before the next frame?
    #[inline(always)]
    pub(super) const fn has_gap(&self) -> bool {
        self.gap.is_some()
    }

    /// A frame ends the gap, and nobody wants a report.
    #[inline(always)]
    pub(super) fn end_gap(&mut self) {
        self.gap = None;
    }

    /// The gap that has ended, if there is one.
    #[inline(always)]
    pub(super) fn take_gap(&mut self) -> Option<Gap> {
        let reason = self.gap?;
        self.gap = None;
        Some(Gap { len: self.skipped.wrapping_sub(self.gap_start), reason })
    }

    /// Bytes taken in, `pending` of them not booked yet.
    #[inline]
    pub(super) const fn received(&self, pending: usize) -> u64 {
        self.framed.wrapping_add(self.skipped).wrapping_add(pending as u64)
    }

    /// The account, with so many bytes not booked yet.
    pub(super) const fn counters(&self, pending: usize) -> Counters {
        let Self { framed, frames, skipped, length, id, crc, idle, gaps, .. } = *self;
        let claimed = length.wrapping_add(id).wrapping_add(crc).wrapping_add(idle);
        Counters {
            received: self.received(pending),
            framed,
            frames,
            gaps,
            header: skipped.wrapping_sub(claimed),
            length,
            id,
            crc,
            idle,
        }
    }
}
