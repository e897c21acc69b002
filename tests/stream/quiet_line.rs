//! Delay and silence: how long a false header holds frames back, and what a quiet line ends.

use axlewire::ikeya;

use crate::{oracle, rig::*};

#[test]
fn the_longest_false_header_delays_a_frame_by_at_most_a_longest_frame() {
    // The header announces a frame of 64 bytes; then motor commands of 24 bytes follow.
    let header = [0xFD, 0xFF, 60, 0];
    let mut line = CheckedLine::<Ucp, 64>::new();
    line.slice(&header);
    for (sent, byte) in motor().into_iter().cycle().take(59).enumerate() {
        line.slice(&[byte]);
        assert!(line.events().is_empty(), "after {sent} bytes");
    }
    line.slice(&[motor()[59 % 24]]);
    // The gap, and both commands that had arrived: 60 of 72 bytes.
    assert_eq!(line.events().len(), 3);
    assert_eq!(line.decoder().pending(), 60 - 48);
    line.finish();
}

#[test]
fn a_quiet_line_ends_the_delay_at_once() {
    let (seen, pending) = seen::<Ucp, 64>(&[&[0xFD, 0xFF, 60, 0], &motor()], true);
    assert_eq!(seen, [Seen::Gap(4, Reason::Idle), Seen::Frame(motor())]);
    assert_eq!(pending, 0);
}

#[test]
fn a_new_candidate_at_the_very_end_outlives_one_quiet_line() {
    let start = &motor()[..10];
    let (first, pending) = seen::<Ucp, 64>(&[&[0xFD, 0xFF, 60, 0], start], true);
    assert_eq!((first, pending), (vec![Seen::Gap(4, Reason::Idle)], 10));
    // The rest still arrives.
    let mut line = CheckedLine::<Ucp, 64>::new();
    line.slice(&[&[0xFD, 0xFF, 60, 0], start].concat());
    line.idle();
    line.slice(&motor()[10..]);
    assert!(matches!(line.events(), [_, oracle::Event::Frame { offset: 4, len: 24 }]));
    line.finish();
}

#[test]
fn a_quiet_line_without_a_candidate_reports_the_gap_and_nothing_else() {
    let (first, pending) = seen::<ikeya::ToSlave, 8>(&[&[1, 2, 3]], true);
    assert_eq!((first, pending), (vec![Seen::Gap(3, Reason::Header)], 0));
    assert_eq!(seen::<ikeya::ToSlave, 8>(&[], true), (vec![], 0));
    assert_eq!(seen::<ikeya::ToSlave, 8>(&[&read()], true), (vec![Seen::Frame(read())], 0));
}

#[test]
fn a_quiet_line_does_not_touch_whole_frames_that_wait_in_the_buffer() {
    let mut line = CheckedLine::<ikeya::ToSlave, 64>::new();
    line.commit(&[&read()[..], &write(), &read()[..2]].concat());
    line.idle();
    line.slice(&[]);
    let idle = oracle::Event::Skipped { offset: 12, len: 2, reason: oracle::Reason::Idle };
    assert_eq!(line.events().len(), 3);
    assert_eq!(line.events().last(), Some(&idle));
    line.finish();
}

#[test]
fn room_for_a_port_hides_no_silence() {
    let mut decoder = Decoder::<ikeya::ToMaster, 16>::new();
    let mut bytes = response().to_vec();
    bytes.extend([0x56, 0x01, 0x02]);
    decoder.spare()[..11].copy_from_slice(&bytes);
    decoder.commit(11);
    assert!(matches!(decoder.poll(), Some(Event::Frame(_))));
    decoder.idle();
    assert_eq!(decoder.spare().len(), 13);
    let gap = Gap { len: 3, reason: Reason::Idle };
    assert_eq!(decoder.poll(), Some(Event::Skipped(gap)));
    // Only its first byte is cut off by the silence; the others start no frame.
    let counters = decoder.counters();
    let of = [Reason::Idle, Reason::Header, Reason::Length, Reason::Id, Reason::Crc];
    assert_eq!(of.map(|reason| counters.skipped_for(reason)), [1, 2, 0, 0, 0]);
    assert_eq!(counters.skipped(), 3);
}

#[test]
fn a_default_decoder_is_a_new_one() {
    let (mut default, mut new) = (Decoder::<Ucp, 64>::default(), Decoder::<Ucp, 64>::new());
    assert_eq!(default.counters(), new.counters());
    assert_eq!((default.pending(), default.spare().len()), (0, new.spare().len()));
}

#[test]
fn a_silence_before_a_commit_spares_what_is_committed() {
    let frame = read();
    let mut decoder = Decoder::<ikeya::ToSlave, 8>::new();
    decoder.idle();
    let mut frames = 0;
    for half in frame.chunks(2) {
        decoder.spare()[..2].copy_from_slice(half);
        decoder.commit(2);
        while let Some(event) = decoder.decode(&mut &[][..]) {
            frames += usize::from(matches!(event, Event::Frame(_)));
        }
    }
    assert_eq!((frames, decoder.counters().skipped()), (1, 0));
}
