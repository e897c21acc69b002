//! Foreign framings: one that breaks its contract hangs nothing, one that asks for more than it
//! needs loses nothing.

use axlewire::stream::decode_capture;

use crate::rig::*;

/// A framing that breaks its contract.
struct Liar<const LIE: u8>;

impl<const LIE: u8> Framing for Liar<LIE> {
    type Frame<'a> = &'a [u8];
    const MIN_LEN: usize = 1;
    const MAX_LEN: usize = 4;

    fn judge(bytes: &[u8]) -> Verdict {
        let reason = Reason::Crc;
        match LIE {
            // A frame longer than the bytes, of no bytes, of more than any length.
            0 => Verdict::Frame { len: bytes.len() + 1 },
            1 => Verdict::Frame { len: 0 },
            2 => Verdict::Frame { len: usize::MAX },
            // A candidate that needs nothing, what it has, everything, one more for ever.
            3 => Verdict::Partial { need: 0 },
            4 => Verdict::Partial { need: bytes.len() },
            5 => Verdict::Partial { need: usize::MAX },
            6 => Verdict::Partial { need: bytes.len() + 1 },
            // A rejection of more than there is, and of an empty slice.
            7 => Verdict::Reject { reason, more: bytes.len() + 5 },
            8 => Verdict::Reject { reason, more: usize::MAX },
            // Behind a rejection: a frame longer than the bytes, of no bytes.
            9 if bytes.first() == Some(&9) => Verdict::Reject { reason, more: 0 },
            9 => Verdict::Frame { len: bytes.len() + 1 },
            10 if bytes.first() == Some(&9) => Verdict::Reject { reason, more: 0 },
            10 => Verdict::Frame { len: 0 },
            // A candidate of two bytes, of which more is rejected than any length.
            13 if bytes.len() < 2 => Verdict::Partial { need: bytes.len() + 1 },
            13 => Verdict::Reject { reason, more: usize::MAX },
            // A frame longer than `MAX_LEN`, and one without a view.
            11 => Verdict::Frame { len: bytes.len() },
            _ => Verdict::Frame { len: bytes.len().min(2) },
        }
    }

    fn view(frame: &[u8]) -> Option<&[u8]> {
        (LIE != 12).then_some(frame)
    }
}

/// Stops a test that does not end.
struct Limit(u32);

impl Limit {
    fn step(&mut self) {
        self.0 = self.0.checked_sub(1).expect("the lie repeats forever");
    }
}

fn check_account(counters: Counters, pending: usize) {
    assert_eq!(counters.received, counters.framed + counters.skipped() + pending as u64);
}

fn feed_decoder<const LIE: u8, const N: usize>(bytes: &[u8], chunk: usize) {
    let mut limit = Limit(1000);
    let mut decoder = Decoder::<Liar<LIE>, N>::new();
    for mut input in bytes.chunks(chunk) {
        while decoder.decode(&mut input).is_some() {
            limit.step();
        }
        // A frame longer than its input may stay there, and one without a view ends the events.
        assert!(input.is_empty() || matches!(LIE, 0 | 2 | 9 | 12));
    }
    for &byte in bytes {
        if decoder.push(byte) {
            while decoder.poll().is_some() {
                limit.step();
            }
        }
    }
    let room = decoder.spare();
    let len = room.len();
    room.fill(9);
    decoder.commit(len);
    while decoder.poll().is_some() {
        limit.step();
    }
    check_account(decoder.counters(), decoder.pending());
    // Once more than needed: an idle line with nothing pending brings nothing.
    let mut is_over = false;
    while !is_over {
        is_over = decoder.pending() == 0;
        limit.step();
        decoder.idle();
        while decoder.poll().is_some() {
            limit.step();
        }
    }
    check_account(decoder.counters(), 0);
}

fn feed_slice<const LIE: u8>(bytes: &[u8]) {
    let mut limit = Limit(1000);
    let mut frames = Frames::<Liar<LIE>>::new(bytes);
    frames.idle();
    while !frames.rest().is_empty() {
        limit.step();
        frames.by_ref().for_each(|_| limit.step());
        check_account(frames.counters(), frames.rest().len());
        frames.idle();
    }
    let mut each = Frames::<Liar<LIE>>::new(bytes);
    each.each(|_| limit.step());
    check_account(each.counters(), each.rest().len());
    let (_, counters) = decode_capture::<Liar<LIE>>(bytes);
    check_account(counters, 0);
    assert_eq!(counters.received, bytes.len() as u64);
}

#[test]
fn a_framing_that_breaks_its_contract_neither_loops_nor_panics_and_the_account_holds() {
    fn feed<const LIE: u8>() {
        for bytes in [&[1; 10][..], &[9, 1, 9, 9, 1, 1, 9, 1, 1, 1], &[9; 7], &[0], &[]] {
            for chunk in [1, 2, 3, 5, 100] {
                feed_decoder::<LIE, 4>(bytes, chunk);
                feed_decoder::<LIE, 9>(bytes, chunk);
            }
            feed_slice::<LIE>(bytes);
        }
    }
    macro_rules! feed_each {
        ($($lie:literal)+) => { $(feed::<$lie>();)+ };
    }
    feed_each!(0 1 2 3 4 5 6 7 8 9 10 11 12 13);
}

/// Frames of three bytes that begin with F, but are judged only when eight bytes are available.
struct Patient;

impl Framing for Patient {
    type Frame<'a> = &'a [u8];
    const MIN_LEN: usize = 3;
    const MAX_LEN: usize = 8;

    fn judge(bytes: &[u8]) -> Verdict {
        match bytes {
            [b'F', ..] | [] if bytes.len() < 8 => Verdict::Partial { need: 8 },
            [b'F', ..] => Verdict::Frame { len: 3 },
            _ => Verdict::Reject { reason: Reason::Header, more: 0 },
        }
    }

    fn view(frame: &[u8]) -> Option<&[u8]> {
        Some(frame)
    }
}

#[test]
fn a_framing_that_asks_for_more_than_it_needs_loses_nothing() {
    let stream = b"F12F34-F56F78F90--------";
    let wanted: [&[u8]; 5] = [b"F12", b"F34", b"F56", b"F78", b"F90"];
    let (mut pushed, mut decoded) = (Vec::new(), Vec::new());
    let mut decoder = Decoder::<Patient, 8>::new();
    for &byte in stream {
        decoder.push(byte);
        while let Some(event) = decoder.poll() {
            if let Event::Frame(frame) = event {
                pushed.push(frame.to_vec());
            }
        }
    }
    assert_eq!(decoder.counters().header, 9);
    let mut decoder = Decoder::<Patient, 8>::new();
    for mut piece in stream.chunks(5) {
        while let Some(event) = decoder.decode(&mut piece) {
            if let Event::Frame(frame) = event {
                decoded.push(frame.to_vec());
            }
        }
    }
    assert_eq!(decoder.counters().header, 9);
    assert_eq!(
        (pushed, decoded),
        (wanted.map(<[u8]>::to_vec).into(), wanted.map(<[u8]>::to_vec).into())
    );
}
