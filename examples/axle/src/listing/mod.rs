//! What `axle decode` prints: frames, gaps and a summary, as JSON lines or as columns.
//!
//! Lines are appended to a buffer, which the caller writes: printing takes longer than decoding.

pub(crate) mod json;
mod number;
pub(crate) mod text;

use axlewire::stream::{Counters, Reason};
use serde::Serialize;

/// All reasons, in the order of the output.
pub(crate) const REASONS: [Reason; 5] =
    [Reason::Header, Reason::Length, Reason::Id, Reason::Crc, Reason::Idle];

/// A run of bytes that belong to no frame.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Skipped {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    /// Why the first byte was skipped.
    pub(crate) reason: Reason,
    /// Bytes by reason, if there are several.
    #[serde(skip_serializing_if = "Reasons::is_one")]
    pub(crate) reasons: Reasons,
}

/// Skipped bytes by reason; JSON has only those that occur.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Reasons {
    #[serde(skip_serializing_if = "is_zero")]
    header: u64,
    #[serde(skip_serializing_if = "is_zero")]
    length: u64,
    #[serde(skip_serializing_if = "is_zero")]
    id: u64,
    #[serde(skip_serializing_if = "is_zero")]
    crc: u64,
    #[serde(skip_serializing_if = "is_zero")]
    idle: u64,
}

impl Reasons {
    /// The bytes that `later` has and `earlier` does not.
    pub(crate) const fn between(earlier: &Counters, later: &Counters) -> Self {
        Self {
            header: later.header.wrapping_sub(earlier.header),
            length: later.length.wrapping_sub(earlier.length),
            id: later.id.wrapping_sub(earlier.id),
            crc: later.crc.wrapping_sub(earlier.crc),
            idle: later.idle.wrapping_sub(earlier.idle),
        }
    }

    fn is_one(&self) -> bool {
        let Self { header, length, id, crc, idle } = *self;
        [header, length, id, crc, idle].into_iter().filter(|bytes| *bytes > 0).count() < 2
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
const fn is_zero(bytes: &u64) -> bool {
    *bytes == 0
}

/// The last record of a listing.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) received: u64,
    pub(crate) framed: u64,
    pub(crate) skipped: u64,
    pub(crate) pending: usize,
    pub(crate) frames: u64,
    pub(crate) skipped_by: Reasons,
    /// For the columns.
    #[serde(skip)]
    counters: Counters,
}

impl Summary {
    pub(crate) fn new(counters: &Counters, pending: usize) -> Self {
        Self {
            received: counters.received,
            framed: counters.framed,
            skipped: counters.skipped(),
            pending,
            frames: counters.frames,
            skipped_by: Reasons::between(&Counters::default(), counters),
            counters: *counters,
        }
    }
}
