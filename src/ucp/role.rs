//! Common to both roles: frames to be sent.

use super::{frame::Body, header::MAX_LEN};
use crate::{encode::Encode, endpoint::Unsent, time::Duration};

/// Shortest period or timeout of a role: a shorter one would make its driver spin.
pub(super) const SHORTEST: Duration = Duration::from_millis(1);

/// Longest pause inside a frame that is sent: a robot of this crate gives the frame up a
/// millisecond later, which a clock that counts milliseconds may not see. Ruling U16 allows 20 ms.
pub(super) const FRAME_PAUSE: Duration = Duration::from_millis(4);

/// What became of a frame: one that was taken whole, with a pause inside, may have arrived.
pub(super) const fn fate(unsent: Unsent, is_taken: bool) -> Unsent {
    match unsent {
        Unsent::CutOff if is_taken => Unsent::Unflushed,
        _ => unsent,
    }
}

/// Encodes a frame to the front of `buffer`; returns its length.
pub(super) fn write<B: Body>(body: B, index: u8, buffer: &mut [u8; MAX_LEN]) -> usize {
    body.frame(index).encode(buffer).map_or(0, <[u8]>::len)
}
