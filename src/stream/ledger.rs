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

/// Where every byte went. All counts wrap at 2^64, which no line reaches.
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

    fn skipped_for_mut(&mut self, reason: Reason) -> &mut u64 {
        match reason {
            Reason::Header => &mut self.header,
            Reason::Length => &mut self.length,
            Reason::Id => &mut self.id,
            Reason::Crc => &mut self.crc,
            Reason::Idle => &mut self.idle,
        }
    }
}

/// The counters and the gap that is open; the one place where bytes are booked.
#[derive(Clone, Debug)]
pub(super) struct Ledger {
    pub(super) counters: Counters,
    pub(super) gap: Option<Gap>,
}

impl Ledger {
    pub(super) const fn new() -> Self {
        let counters = Counters {
            received: 0,
            framed: 0,
            frames: 0,
            gaps: 0,
            header: 0,
            length: 0,
            id: 0,
            crc: 0,
            idle: 0,
        };
        Self { counters, gap: None }
    }

    // Out of line: inlined, an open gap takes the registers that the next good frame needs.
    #[inline(never)]
    pub(super) fn skip(&mut self, reason: Reason, len: usize) {
        let len = len as u64;
        let count = self.counters.skipped_for_mut(reason);
        *count = count.wrapping_add(len);
        match &mut self.gap {
            Some(gap) => gap.len = gap.len.wrapping_add(len),
            None => {
                self.gap = Some(Gap { len, reason });
                self.counters.gaps = self.counters.gaps.wrapping_add(1);
            }
        }
    }

    #[inline]
    pub(super) fn frame(&mut self, len: usize) {
        self.counters.framed = self.counters.framed.wrapping_add(len as u64);
        self.counters.frames = self.counters.frames.wrapping_add(1);
    }
}
