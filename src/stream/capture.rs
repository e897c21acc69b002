//! Decoding of a whole capture, for hosts.

use alloc::vec::Vec;

use super::{
    event::Event,
    framing::Framing,
    ledger::{Counters, Ledger},
    search::{Front, search},
};

/// An event, with the offset of its first byte in the capture.
pub type Located<T> = (usize, Event<T>);

/// Decodes a capture that is already in memory: each event with the offset of its first byte, and
/// the account. The capture is the bytes of a line and nothing else; for pcapng files there is
/// `axle decode`.
///
/// Nothing follows a capture, so a candidate cut off by its end is refused as
/// [`Reason::Idle`](super::Reason::Idle), and whole frames inside it are found. Needs feature
/// `alloc`.
///
/// ```
/// # #[cfg(feature = "ucp")] {
/// use axlewire::{stream::{Event, Gap, Reason, decode_capture}, ucp::Ucp};
///
/// // A ping, and half a ping.
/// let bytes = [0xFD, 0xFF, 4, 0, 1, 0, 0x01, 0x42, 0xFD, 0xFF, 4, 0];
/// let (events, counters) = decode_capture::<Ucp>(&bytes);
/// assert!(matches!(events[0], (0, Event::Frame(frame)) if frame.id() == 1));
/// assert!(matches!(events[1], (8, Event::Skipped(Gap { len: 4, reason: Reason::Idle }))));
/// assert_eq!((counters.frames, counters.skipped()), (1, 4));
/// # }
/// ```
#[must_use]
pub fn decode_capture<F: Framing>(bytes: &[u8]) -> (Vec<Located<F::Frame<'_>>>, Counters) {
    let (mut events, mut ledger, mut at) = (Vec::new(), Ledger::new(), 0);
    while let Some(rest) = bytes.get(at..) {
        let (found, front) = search::<F>(rest, &mut ledger, Ledger::refuse);
        at = bytes.len() - found.len();
        let frame = match front {
            Front::Frame { len } => found.get(..len),
            Front::Partial { .. } => None,
        };
        if frame.is_none() && at < bytes.len() {
            ledger.refuse_idle();
            at += 1;
            continue;
        }
        if let Some(gap) = ledger.take_gap() {
            events.push((at - gap.len as usize, Event::Skipped(gap)));
        }
        let Some(frame) = frame else { break };
        events.extend(F::view(frame).map(|view| (at, Event::Frame(view))));
        ledger.frame(frame.len());
        at += frame.len();
    }
    (events, ledger.counters(0))
}
