//! Events of a stream.

use core::fmt;

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

/// The frame, or the gap.
impl<T: fmt::Display> fmt::Display for Event<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame(frame) => frame.fmt(f),
            Self::Skipped(gap) => gap.fmt(f),
        }
    }
}
