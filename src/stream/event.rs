//! Events of a stream.

use super::ledger::Gap;

/// An event of a stream: a frame, or a gap between frames.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event<T> {
    /// A whole frame with a correct CRC.
    Frame(T),
    /// A gap, reported when a frame or a quiet line ends it.
    Skipped(Gap),
}
