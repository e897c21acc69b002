//! Events of a stream.

use super::ledger::Gap;

/// What a stream brings: frames, and the gaps between them.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event<T> {
    /// A whole frame with the right CRC.
    Frame(T),
    /// A gap, reported when a frame or a quiet line has ended it.
    Skipped(Gap),
}
