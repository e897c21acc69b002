//! Splitting a capture: the sides, decoded apart, give what the oracle says of the whole.

use axlewire::stream;

use crate::{
    oracle::{self, Answer},
    rig::*,
};

/// What the oracle says of the whole is what it says of both sides of every place, one after the
/// other; and there is a place wherever the text of `split_point` says that there is one.
pub(crate) fn check_split_points<F: Known>(bytes: &[u8]) {
    let whole = oracle::answer(F::RULES, bytes, &[]);
    let mut from = 0;
    while from <= bytes.len() {
        let place = stream::split_point::<F>(bytes, from);
        assert_eq!(place, first_place::<F>(bytes, from), "from {from}");
        let Some(place) = place else { break };
        let (front, back) = bytes.split_at(place);
        let (front, mut back) =
            (oracle::answer(F::RULES, front, &[]), oracle::answer(F::RULES, back, &[]));
        assert_eq!((front.open, front.pending), (0, 0), "the front is complete at {place}");
        back.move_by(place);
        assert_eq!(joined(front, back), whole, "split at {place}");
        from += 1 + from / 8;
    }
    assert_eq!(stream::split_point::<F>(bytes, bytes.len() + 1), None);
}

/// The parts are the whole, have the asked length, and give its frames and its account.
pub(crate) fn check_parts<F: Known>(bytes: &[u8], len: usize) {
    let mut rest = stream::parts::<F>(bytes, len);
    let parts: Vec<_> = rest.clone().collect();
    // A copy goes on where the first one is.
    rest.next();
    assert!(rest.clone().eq(parts.iter().skip(1).copied()));
    assert_eq!(parts.concat(), bytes);
    let last = parts.len().saturating_sub(1);
    assert!(parts.iter().take(last).all(|part| part.len() >= len.max(1)));
    let (mut frames, mut sum) = (Vec::new(), Counters::default());
    for part in parts {
        let mut part = Frames::<F>::new(part);
        part.each(|frame| frames.push(F::bytes(&frame).to_vec()));
        sum += part.counters();
    }
    let mut whole = Frames::<F>::new(bytes);
    let mut expected = Vec::new();
    whole.each(|frame| expected.push(F::bytes(&frame).to_vec()));
    assert_eq!(frames, expected);
    assert_eq!(sum, whole.counters());
}

fn joined(mut front: Answer, back: Answer) -> Answer {
    front.events.extend(back.events);
    (front.open, front.pending) = (back.open, back.pending);
    front.gaps += back.gaps;
    front.skipped.iter_mut().zip(back.skipped).for_each(|(sum, more)| *sum += more);
    front
}

/// The slow way: the first frame from here on before which every start, whichever it is, leads to
/// it, judged with no byte from behind it.
fn first_place<F: Known>(bytes: &[u8], from: usize) -> Option<usize> {
    // The frames that a search from here meets.
    let met = oracle::answer(F::RULES, bytes.get(from..)?, &[]).frames();
    let met = met.into_iter().map(|(offset, len)| (from + offset, from + offset + len));
    met.into_iter().find_map(|(frame, end)| {
        let leads_here = |start: usize| {
            let answer = oracle::answer(F::RULES, &bytes[start..end], &[]);
            answer.pending == 0 && answer.frames().contains(&(frame - start, end - frame))
        };
        let first = frame.saturating_sub(F::MAX_LEN - 1);
        (first..frame).all(leads_here).then_some(end)
    })
}

#[test]
fn a_frame_that_another_one_contains_is_no_place() {
    // A frame with a whole ping as the body of an unknown message: a search from inside it meets
    // the ping, one from before it does not.
    let ping = [0xFD, 0xFF, 4, 0, 1, 0, 0x01, 0x42];
    let mut outer = [&[0xFD, 0xFF, 12, 0, 0x20, 0][..], &ping, &[0, 0]].concat();
    oracle::seal(&mut outer);
    let bytes = [&outer[..], &motor()].concat();
    assert_eq!(stream::split_point::<Ucp>(&bytes, 1), Some(bytes.len()));
    assert_eq!(stream::split_point::<Ucp>(&bytes, 0), Some(outer.len()));
}

#[test]
fn a_frame_that_overlaps_the_one_before_is_no_place() {
    // The second frame begins with the last body bytes and the CRC of the first.
    let mut bytes = vec![0xFD, 0xFF, 8, 0, 0x20, 0, 0xFD, 0xFF, 6, 0, 0, 0];
    oracle::seal(&mut bytes);
    bytes.extend([1, 2, 0, 0]);
    oracle::seal(&mut bytes[6..]);
    bytes.extend(motor());
    check_split_points::<Ucp>(&bytes);
    // A search from inside the first frame meets the second.
    assert_eq!(stream::split_point::<Ucp>(&bytes, 1), Some(bytes.len()));
}

#[test]
fn a_packet_of_an_impossible_node_that_overlaps_the_next_is_no_place() {
    // A READ of node 9 is skipped whole, with the first byte of the answer at its end.
    let id = (9..=255).find(|&id| {
        let mut read = [0xAA, id, 0, 0];
        oracle::seal(&mut read);
        read[3] == 0x55
    });
    let mut bytes = vec![0xAA, id.unwrap(), 0, 0];
    oracle::seal(&mut bytes);
    bytes.extend(&response()[1..]);
    bytes.extend(response());
    check_split_points::<axlewire::ikeya::BothDirections>(&bytes);
    let place = stream::split_point::<axlewire::ikeya::BothDirections>(&bytes, 1);
    assert_eq!(place, Some(bytes.len()));
}

#[test]
fn a_damaged_frame_that_reaches_over_the_place_moves_it() {
    // The header promises 40 bytes more, into the second command behind it. Without what follows,
    // the front could not tell a wrong CRC from a frame that was cut off.
    let bytes = [&[0xFD, 0xFF, 40, 0][..], &motor(), &motor(), &motor()].concat();
    let place = stream::split_point::<axlewire::ucp::Ucp>(&bytes, 0).unwrap();
    assert_eq!(place, 4 + 2 * motor().len());
    type Ucp = axlewire::ucp::Ucp;
    let (seen, pending) = seen::<Ucp, 256>(&[&bytes[..place]], true);
    assert_eq!((seen.len(), pending), (3, 0));
    assert_eq!(seen[0], Seen::Gap(4, Reason::Crc));
}

#[test]
fn a_capture_without_frames_is_one_part() {
    let bytes = [0; 1000];
    let parts: Vec<_> = stream::parts::<axlewire::ikeya::ToMaster>(&bytes, 10).collect();
    assert_eq!(parts, [&bytes[..]]);
    assert_eq!(stream::parts::<axlewire::ikeya::ToMaster>(&[], 10).count(), 0);
    let answers = response().repeat(3);
    let parts: Vec<_> = stream::parts::<axlewire::ikeya::ToMaster>(&answers, 0).collect();
    assert_eq!(parts, [&answers[..8], &answers[8..16], &answers[16..]]);
}

#[test]
fn a_framing_that_breaks_its_contract_only_moves_the_place() {
    /// Claims frames of any length, also longer than the slice and than itself.
    enum Liar {}
    impl Framing for Liar {
        type Frame<'a> = &'a [u8];
        const MIN_LEN: usize = 1;
        const MAX_LEN: usize = 4;

        fn judge(bytes: &[u8]) -> Verdict {
            match bytes.first() {
                None => Verdict::Partial { need: 0 },
                Some(&len @ ..10) => Verdict::Frame { len: len.into() },
                Some(10) => Verdict::Frame { len: usize::MAX },
                Some(11) => Verdict::Reject { reason: Reason::Header, more: usize::MAX },
                Some(_) => Verdict::Partial { need: 0 },
            }
        }

        fn view(frame: &[u8]) -> Option<&[u8]> {
            Some(frame)
        }
    }
    for first in 0..14 {
        for second in 0..14 {
            let bytes = [first, second, 1, 12, 1, 3, 2, second, first, 1, 1, 1];
            for from in 0..=bytes.len() {
                let place = stream::split_point::<Liar>(&bytes, from);
                assert!(place.is_none_or(|place| place > from && place <= bytes.len()));
            }
            assert_eq!(stream::parts::<Liar>(&bytes, 1).collect::<Vec<_>>().concat(), bytes);
        }
    }
}

#[test]
fn a_decoder_that_goes_on_at_a_place_needs_nothing_from_before() {
    let capture = [&response()[..], &[0x55, 0x01], &response(), &response()].concat();
    type F = axlewire::ikeya::ToMaster;
    let place = stream::split_point::<F>(&capture, 1).unwrap();
    let mut whole = Decoder::<F, 8>::new();
    let mut input = &capture[..place];
    let mut events = 0;
    while let Some(event) = whole.decode(&mut input) {
        events += 1;
        assert!(matches!(event, Event::Frame(_) | Event::Skipped(Gap { len: 2, .. })));
    }
    assert_eq!((events, whole.pending(), whole.counters().received), (3, 0, place as u64));
}
