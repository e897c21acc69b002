//! The buffer of a decoder: frames in pieces, frames that are not copied, copies, and overflow.

use axlewire::{ikeya, ucp};

use crate::{checked_line, rig::*};

#[test]
fn a_frame_cut_anywhere_arrives_whole() {
    for cut in 0..=motor().len() {
        let (head, tail) = (&motor()[..cut], &motor()[cut..]);
        let (seen, pending) = seen::<Ucp, 64>(&[head, &[], tail], false);
        assert_eq!((seen, pending), (vec![Seen::Frame(motor())], 0), "cut at {cut}");
    }
}

#[test]
fn frames_behind_a_false_header_of_an_earlier_chunk_are_not_copied() {
    let chunk = [motor(), motor(), motor()].concat();
    let mut decoder = ucp::Decoder::new();
    let mut places = Vec::new();
    for mut input in [&[0xFD, 0xFF, 60, 0], chunk.as_slice()] {
        while let Some(event) = decoder.decode(&mut input) {
            if let Event::Frame(frame) = event {
                places.push(checked_line::place_in(&chunk, frame.as_bytes()));
            }
        }
    }
    assert_eq!(places, [(0, 24), (24, 24), (48, 24)]);
}

#[test]
fn a_copy_of_a_decoder_is_independent() {
    let response = response();
    let (start, end) = response.split_at(5);
    let mut decoder = Decoder::<ikeya::ToMaster, 8>::new();
    assert!(decoder.decode(&mut { start }).is_none());
    let mut copy = decoder.clone();
    for decoder in [&mut decoder, &mut copy] {
        assert!(matches!(decoder.decode(&mut { end }), Some(Event::Frame(_))));
        assert_eq!(decoder.counters().frames, 1);
    }
    let mut frames = Frames::<ikeya::ToMaster>::new(&response);
    assert_eq!(frames.clone().count(), 1);
    assert_eq!(frames.by_ref().count(), 1);
}

#[test]
fn a_byte_pushed_into_a_full_buffer_is_refused() {
    let mut decoder = Decoder::<ikeya::ToMaster, 8>::new();
    let answers: Vec<_> = (0..10).map(|_| decoder.push(0)).collect();
    assert_eq!(answers, [[false; 7].as_slice(), &[true; 3]].concat());
    assert_eq!((decoder.received(), decoder.pending()), (8, 8));
    assert_eq!(decoder.poll(), None);
    assert_eq!((decoder.received(), decoder.counters().header, decoder.pending()), (8, 8, 0));
    // And there is room again.
    for byte in response() {
        decoder.push(byte);
    }
    assert!(matches!(decoder.poll(), Some(Event::Skipped(Gap { len: 8, reason: Reason::Header }))));
    assert!(matches!(decoder.poll(), Some(Event::Frame(_))));
}

#[test]
fn a_commit_cannot_exceed_the_available_room() {
    let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
    decoder.commit(usize::MAX);
    assert_eq!((decoder.counters().received, decoder.pending()), (8, 8));
    assert!(decoder.spare().is_empty());
    while decoder.decode(&mut &[][..]).is_some() {}
    assert_eq!((decoder.counters().header, decoder.spare().len()), (8, 8));
    // Nor what is left of it.
    decoder.commit(3);
    decoder.commit(6);
    assert_eq!((decoder.counters().received, decoder.pending()), (16, 8));
}

#[test]
fn a_decoder_prints_what_it_holds() {
    let mut decoder = ucp::Decoder::new();
    assert_eq!(decoder.decode(&mut &[0xFD, 0xFF, 5][..]), None);
    let said = format!("{decoder:?}");
    assert!(said.starts_with("Decoder { held: [253, 255, 5], line: "), "{said}");
}

#[test]
fn an_idle_line_takes_no_whole_frame_that_was_not_asked_for_yet() {
    for bytes in [motor(), [motor(), motor()].concat()] {
        let mut frames = Frames::<Ucp>::new(&bytes);
        frames.idle();
        assert_eq!(frames.by_ref().count(), bytes.len() / motor().len());
    }
}

#[test]
fn a_beginning_needs_more_than_it_has_and_no_more_than_its_frame() {
    fn check<F: Framing>(frame: &[u8]) {
        for len in 0..frame.len() {
            match F::judge(&frame[..len]) {
                Verdict::Partial { need } => assert!((len + 1..=frame.len()).contains(&need)),
                verdict => panic!("{verdict:?} of the first {len} bytes"),
            }
        }
        assert_eq!(F::judge(frame), Verdict::Frame { len: frame.len() });
    }
    check::<Ucp>(&motor());
    check::<ikeya::ToMaster>(&response());
}
