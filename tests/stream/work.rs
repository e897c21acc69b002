//! Work: a candidate that arrives in pieces is judged no more often than necessary.

use crate::{judged_work::{self, Counted}, rig::*};

#[test]
fn a_split_candidate_is_judged_no_more_often_than_its_bytes_can_change_the_verdict() {
    let frame = hostile_streams::ucp_frame_around(0x20, &[0; 56]);
    judged_work::reset();
    let mut line = CheckedLine::<Counted<Ucp>, 64>::new();
    for byte in &frame[..63] {
        line.slice(&[*byte]);
    }
    // One byte, the sync, half a length, a length.
    assert_eq!(judged_work::counts(), (4, 0));
    line.slice(&frame[63..]);
    assert_eq!((line.events().len(), judged_work::counts().1), (1, 1));
    line.finish();
}
