//! Bounded work: how often a decoder judges bytes, by a counter and not by a clock.

use std::cell::Cell;

use axlewire::stream::{Framing, Reason, Verdict};

use super::{
    checked_line::{CheckedLine, Op},
    known_framings::Known,
    oracle::Rules,
};

thread_local! {
    static JUDGED: Cell<u64> = const { Cell::new(0) };
    static CHECKED: Cell<u64> = const { Cell::new(0) };
}

/// Wraps a framing and counts how often it is asked, and how often about a whole candidate.
pub(crate) struct Counted<F>(F);

impl<F: Known> Framing for Counted<F> {
    type Frame<'a> = F::Frame<'a>;
    const MIN_LEN: usize = F::MIN_LEN;
    const MAX_LEN: usize = F::MAX_LEN;

    fn judge(bytes: &[u8]) -> Verdict {
        let verdict = F::judge(bytes);
        JUDGED.set(JUDGED.get() + 1);
        let whole = match verdict {
            Verdict::Frame { .. } => true,
            Verdict::Reject { reason, .. } => matches!(reason, Reason::Crc | Reason::Id),
            Verdict::Partial { .. } => false,
        };
        CHECKED.set(CHECKED.get() + u64::from(whole));
        verdict
    }

    fn view(frame: &[u8]) -> Option<F::Frame<'_>> {
        F::view(frame)
    }
}

impl<F: Known> Known for Counted<F> {
    const RULES: Rules = F::RULES;

    fn bytes<'a: 'a>(frame: &F::Frame<'a>) -> &'a [u8] {
        F::bytes(frame)
    }
}

/// How often bytes were judged on this thread since the last [`reset`], and how often as a whole
/// candidate.
pub(crate) fn counts() -> (u64, u64) {
    (JUDGED.get(), CHECKED.get())
}

/// Counts from zero again.
pub(crate) fn reset() {
    JUDGED.set(0);
    CHECKED.set(0);
}

/// A checksum is computed once for every possible start of a candidate, and again at most twice for
/// a frame: when a gap before it is reported, and when it is read in place. Short looks happen a
/// few times for each byte and for each call.
pub(crate) fn check_work<F: Known, const N: usize>(stream: &[u8], ops: &[Op]) {
    reset();
    let calls = CheckedLine::<Counted<F>, N>::new().play(stream, ops);
    let bytes = stream.len() as u64;
    let frames = bytes / 4;
    let (judged, checked) = counts();
    assert!(checked <= bytes + 2 * frames, "{checked} of {bytes} bytes");
    assert!(judged <= 6 * bytes + 3 * calls, "{judged} for {bytes} bytes");
    assert!(bytes < 4 || judged > 0, "nothing was judged");
}
