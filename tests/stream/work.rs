//! Work: a candidate that arrives in pieces is judged no more often than necessary.

use std::cell::Cell;

use axlewire::{
    stream::{Framing, OneByOne, Reason, Verdict},
    ucp::Ucp,
};

use crate::{
    checked_line::{CheckedLine, Op},
    hostile_streams,
    known_framings::Known,
    oracle::Rules,
};

thread_local! {
    static JUDGED: Cell<u64> = const { Cell::new(0) };
    static CHECKED: Cell<u64> = const { Cell::new(0) };
}

/// Wraps a framing and counts how often it is asked, and how often about a whole candidate.
struct Counted<F>(F);

impl<F: Known> Framing for Counted<F> {
    type Frame<'a> = F::Frame<'a>;
    type Batch = OneByOne;
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

/// A checksum is computed once for every possible start of a candidate, and again at most twice for
/// a frame: when a gap before it is reported, and when it is read in place. Short looks happen a
/// few times for each byte and for each call.
pub(crate) fn check_work<F: Known, const N: usize>(stream: &[u8], ops: &[Op]) {
    JUDGED.set(0);
    CHECKED.set(0);
    let calls = CheckedLine::<Counted<F>, N>::new().play(stream, ops);
    let bytes = stream.len() as u64;
    let frames = bytes / 4;
    assert!(CHECKED.get() <= bytes + 2 * frames, "{} of {bytes} bytes", CHECKED.get());
    assert!(JUDGED.get() <= 6 * bytes + 3 * calls, "{} for {bytes} bytes", JUDGED.get());
}

#[test]
fn a_split_candidate_is_judged_no_more_often_than_its_bytes_can_change_the_verdict() {
    let frame = hostile_streams::ucp_frame_around(0x20, &[0; 56]);
    JUDGED.set(0);
    CHECKED.set(0);
    let mut line = CheckedLine::<Counted<Ucp>, 64>::new();
    for byte in &frame[..63] {
        line.slice(&[*byte]);
    }
    // One byte, the sync, half a length, a length.
    assert_eq!((JUDGED.get(), CHECKED.get()), (4, 0));
    line.slice(&frame[63..]);
    assert_eq!((line.events().len(), CHECKED.get()), (1, 1));
    line.finish();
}
