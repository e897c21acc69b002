//! What is told of an event besides its frame.

use axlewire::stream::{Counters, Reason};

use crate::pcapng::Direction;

/// Where and when an event was on the line.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// Offset of its first byte in the bytes of its interface and direction.
    pub(crate) offset: u64,
    /// When its last byte had been received, microseconds since 1970; `None` if the capture has no
    /// times.
    pub(crate) micros: Option<u64>,
    pub(crate) direction: Option<Direction>,
    /// The interface, if the capture has such.
    pub(crate) interface: Option<usize>,
}

/// A run of bytes that belong to no frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkippedBytes {
    pub(crate) length: u64,
    /// Why its first byte was skipped.
    pub(crate) reason: Reason,
    /// The account of all its bytes.
    pub(crate) account: Counters,
}

/// All reasons, in the order in which they are printed.
pub(crate) const REASONS: [Reason; 5] =
    [Reason::Header, Reason::Length, Reason::Id, Reason::Crc, Reason::Idle];

/// Number of bytes that are in no other count: they may still become a frame (ruling B2).
pub(crate) const fn pending(counters: &Counters) -> u64 {
    counters.received - counters.framed - counters.skipped()
}

/// What the time column counts from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LineClock {
    pub(super) first: Option<u64>,
    pub(super) last: Option<u64>,
}
