//! A framing that rejects more bytes than are available does not make a decoder run past its input.

use std::{cell::Cell, panic::catch_unwind};

use axlewire::stream::{Counters, Decoder, Frames, Framing, OneByOne, Reason, Verdict};

thread_local! {
    static JUDGED: Cell<u32> = const { Cell::new(0) };
}

/// Rejects everything after two bytes, without limit.
#[derive(Debug)]
enum Boundless {}

impl Framing for Boundless {
    type Frame<'a> = ();
    type Batch = OneByOne;
    const MIN_LEN: usize = 2;
    const MAX_LEN: usize = 2;

    fn judge(bytes: &[u8]) -> Verdict {
        JUDGED.set(JUDGED.get() + 1);
        assert!(JUDGED.get() < 1000, "the search makes no progress");
        match bytes.len() {
            len @ 0..2 => Verdict::Partial { need: len + 1 },
            _ => Verdict::Reject { reason: Reason::Crc, more: usize::MAX },
        }
    }

    fn view(_: &[u8]) -> Option<()> {
        None
    }
}

fn has_refused(counters: Counters, len: u64) -> bool {
    (counters.received, counters.crc, counters.skipped()) == (len, len, len)
}

#[test]
fn a_framing_that_rejects_without_bound_stops_at_the_end_of_the_slice() {
    let searched = catch_unwind(|| {
        let mut frames = Frames::<Boundless>::new(&[1, 2, 3]);
        frames.next().is_none() && has_refused(frames.counters(), 3)
    });
    assert!(matches!(searched, Ok(true)), "the length of a rejection overflows in a slice");
}

#[test]
fn a_framing_that_rejects_without_bound_stops_at_the_end_of_the_chunk() {
    for chunk in 1..=6 {
        let searched = catch_unwind(|| {
            let mut decoder = Decoder::<Boundless, 8>::new();
            for mut bytes in [1, 2, 3, 4, 5, 6].chunks(chunk) {
                while decoder.decode(&mut bytes).is_some() {}
            }
            while decoder.pending() > 0 {
                decoder.idle();
                while decoder.decode(&mut [].as_slice()).is_some() {}
            }
            let counters = decoder.counters();
            (counters.received, counters.skipped()) == (6, 6)
        });
        assert!(matches!(searched, Ok(true)), "the length of a rejection overflows in a decoder");
    }
}
