//! The account of every byte: counters, reasons, gaps.

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
    /// The length field has a value that occurs in no frame.
    Length,
    /// A whole packet with a correct CRC for a node that cannot exist (ruling I1).
    Id,
    /// The CRC does not match the bytes in front of it.
    Crc,
    /// The line went quiet in the middle of the candidate (ruling B3).
    Idle,
}

impl Reason {
    /// The reason as one lower-case word: `header`, `length`, `id`, `crc` or `idle`.
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

    /// The reason in a few words, for people: `no frame starts here`.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Header => "no frame starts here",
            Self::Length => "invalid length",
            Self::Id => "invalid node id",
            Self::Crc => "damaged, or not a frame",
            Self::Idle => "truncated at the end",
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
    /// Length, bytes; at least 1. In `serde` its name is `length`, as that of a frame.
    #[cfg_attr(feature = "serde", serde(rename = "length"))]
    pub len: u64,
    /// Why its first byte was skipped.
    pub reason: Reason,
}

/// Length and reason: `3 bytes skipped: header, no frame starts here`.
impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { len, reason } = self;
        let bytes = if *len == 1 { "byte" } else { "bytes" };
        write!(f, "{len} {bytes} skipped: {reason}, {}", reason.meaning())
    }
}

/// The account of every byte: `received == framed + skipped() + pending`. All counts wrap at 2^64,
/// which no line reaches.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Counters {
    /// Bytes received.
    pub received: u64,
    /// Bytes that belong to delivered frames.
    pub framed: u64,
    /// Frames delivered.
    pub frames: u64,
    /// Gaps, including one that has not ended yet.
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

/// Adds the account of another part of a stream, such as a part of a capture
/// ([`parts`](super::parts)).
impl core::ops::AddAssign for Counters {
    fn add_assign(&mut self, more: Self) {
        let sums = [
            (&mut self.received, more.received),
            (&mut self.framed, more.framed),
            (&mut self.frames, more.frames),
            (&mut self.gaps, more.gaps),
            (&mut self.header, more.header),
            (&mut self.length, more.length),
            (&mut self.id, more.id),
            (&mut self.crc, more.crc),
            (&mut self.idle, more.idle),
        ];
        for (sum, more) in sums {
            *sum = sum.wrapping_add(more);
        }
    }
}

/// The only place where bytes are booked.
///
/// Counts only what cannot be derived: a frame costs two additions, and a byte that starts no frame
/// has no count of its own.
#[derive(Clone, Debug)]
pub(super) struct Ledger {
    framed: u64,
    /// Bytes in all gaps. Those in no other count are [`Reason::Header`].
    skipped: u64,
    length: u64,
    id: u64,
    crc: u64,
    idle: u64,
    /// Not next to `framed`: on a host the compiler would count both in one 128-bit register, and
    /// each frame would wait for the store of the frame before.
    frames: u64,
    gaps: u64,
    /// Why the open gap began.
    gap: Option<Reason>,
    /// Value of `skipped` at that time.
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

    /// Books a frame of `len` bytes. If a gap is open, take it or end it first.
    #[inline(always)]
    pub(super) fn frame(&mut self, len: usize) {
        self.frames(1, len);
    }

    /// Books this number of frames, of `len` bytes in total.
    #[inline(always)]
    pub(super) fn frames(&mut self, frames: usize, len: usize) {
        self.framed = self.framed.wrapping_add(len as u64);
        self.frames = self.frames.wrapping_add(frames as u64);
    }

    /// Books `len` bytes as refused for this reason; `skip` counts them.
    ///
    /// Adds to every count, mostly zero: on a microcontroller the compiler can then drop the counts
    /// that are never read.
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

    /// Out-of-line `refuse`, to save code size where the counts are read.
    #[inline(never)]
    pub(super) fn refuse_apart(&mut self, reason: Reason, len: usize) {
        self.refuse(reason, len);
    }

    /// Books the first byte of a candidate that a quiet line cuts off.
    pub(super) fn refuse_idle(&mut self) {
        self.refuse(Reason::Idle, 1);
        self.skip(1);
    }

    /// Counts `len` refused bytes.
    #[inline(always)]
    pub(super) fn skip(&mut self, len: usize) {
        self.skipped = self.skipped.wrapping_add(len as u64);
    }

    /// Whether there is a gap to report before the next frame.
    #[inline(always)]
    pub(super) const fn has_gap(&self) -> bool {
        self.gap.is_some()
    }

    /// Ends the gap, if one is open, without a report.
    #[inline(always)]
    pub(super) fn end_gap(&mut self) {
        self.gap = None;
    }

    /// Ends the gap, if one is open, and returns it.
    #[inline(always)]
    pub(super) fn take_gap(&mut self) -> Option<Gap> {
        let reason = self.gap?;
        self.gap = None;
        Some(Gap { len: self.skipped.wrapping_sub(self.gap_start), reason })
    }

    /// Bytes received, `pending` of them not booked yet.
    #[inline]
    pub(super) const fn received(&self, pending: usize) -> u64 {
        self.framed.wrapping_add(self.skipped).wrapping_add(pending as u64)
    }

    /// The account, with `pending` bytes not booked yet.
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
