//! The stream layer against the slow oracle, on hostile streams, and as stories told by hand.
#![cfg(all(feature = "ikeya", feature = "ucp"))]

#[path = "support/checked_line.rs"]
mod checked_line;
#[path = "support/hostile_streams.rs"]
mod hostile_streams;
#[path = "support/oracle.rs"]
mod oracle;

use std::cell::Cell;

use axlewire::{
    ikeya::{self, NodeId, Position, Rps, three},
    stream::{Decoder, Event, Frames, Framing, Gap, Reason, Verdict},
    ucp::{self, Body, MotorControl, Ucp},
};
use checked_line::{Known, Line, Op};
use oracle::Rules;
use proptest::{collection::vec, prelude::*};

// Properties, for every framing.

macro_rules! properties {
    ($($name:ident: $framing:ty, $max_len:literal;)+) => {$(
        mod $name {
            use super::*;

            type F = $framing;
            const MAX_LEN: usize = $max_len;

            fn stream() -> impl Strategy<Value = Vec<u8>> {
                hostile_streams::stream(F::RULES)
            }

            #[test]
            fn the_smallest_buffer_is_the_longest_frame() {
                assert_eq!(<F as Framing>::MAX_LEN, MAX_LEN);
            }

            proptest! {
                #[test]
                fn a_slice_gives_what_the_oracle_says(stream in stream()) {
                    checked_line::check_slice::<F>(&stream);
                }

                #[test]
                fn a_finished_slice_gives_what_the_oracle_says(stream in stream()) {
                    checked_line::check_finished_slice::<F>(&stream);
                }

                #[test]
                fn single_bytes_give_what_the_oracle_says(stream in stream()) {
                    Line::<F, MAX_LEN>::new().play(&stream, &[Op::Slice(1)]);
                    Line::<F, MAX_LEN>::new().play(&stream, &[Op::Commit(1), Op::Drain]);
                }

                #[test]
                fn pushed_bytes_give_what_the_oracle_says(stream in stream()) {
                    Line::<F, MAX_LEN>::new().play(&stream, &[Op::Push(1)]);
                    Line::<F, MAX_LEN>::new().play(&stream, &[Op::Push(5), Op::Slice(3), Op::Idle]);
                }

                #[test]
                fn chunks_do_not_matter(stream in stream(), chunks in vec(0..80_usize, 1..8)) {
                    let ops: Vec<_> = chunks.into_iter().map(Op::Slice).collect();
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn a_port_may_fill_the_buffer(
                    stream in stream(),
                    chunks in vec((0..300_usize, any::<bool>()), 1..8),
                ) {
                    let drained = |(len, drain)| [Op::Commit(len), if drain { Op::Drain } else { Op::Commit(1) }];
                    let mut ops: Vec<_> = chunks.into_iter().flat_map(drained).collect();
                    ops.push(Op::Drain);
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                    Line::<F, { MAX_LEN + 1 }>::new().play(&stream, &ops);
                    Line::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn an_idle_line_ends_candidates_anywhere(
                    stream in stream(),
                    chunks in vec(0..40_usize, 1..8),
                ) {
                    let quiet = |len| [Op::Slice(len), Op::Idle];
                    let ops: Vec<_> = chunks.into_iter().flat_map(quiet).collect();
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn an_idle_line_loses_no_frame_that_is_still_in_the_buffer(
                    stream in stream(),
                    chunks in vec(0..300_usize, 1..8),
                ) {
                    let quiet = |len| [Op::Commit(len), Op::Idle, Op::Drain];
                    let ops: Vec<_> = chunks.into_iter().flat_map(quiet).collect();
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                    Line::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn stopping_early_loses_nothing(
                    stream in stream(),
                    stops in vec((1..200_usize, 0..4_usize), 1..8),
                ) {
                    let stop = |(len, events)| Op::Stop { len, events };
                    let ops: Vec<_> = stops.into_iter().map(stop).collect();
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn nothing_that_a_user_does_matters(stream in stream(), ops in hostile_streams::ops()) {
                    Line::<F, MAX_LEN>::new().play(&stream, &ops);
                    Line::<F, { MAX_LEN + 1 }>::new().play(&stream, &ops);
                    Line::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn a_start_delays_a_frame_by_less_than_a_frame(
                    stream in stream(),
                    frame in hostile_streams::frame(F::RULES),
                ) {
                    check_stall::<F, MAX_LEN>(&stream, &frame);
                }

                #[test]
                fn work_is_bounded(stream in stream(), ops in hostile_streams::ops()) {
                    check_work::<F, MAX_LEN>(&stream, &ops);
                    check_work::<F, MAX_LEN>(&stream, &[Op::Slice(1)]);
                }
            }
        }
    )+};
}

properties! {
    ikeya_to_slave: ikeya::ToSlave, 8;
    ikeya_to_master: ikeya::ToMaster, 8;
    ikeya_either: ikeya::Either, 8;
    three_to_slave: three::ToSlave, 16;
    three_to_master: three::ToMaster, 16;
    three_either: three::Either, 16;
    ucp_by_default: Ucp, 64;
    ucp_with_the_largest_cap: Ucp<252>, 256;
}

/// B3: whatever came before, less than a longest frame is held back, and a quiet line ends that;
/// the first good frame then comes out with its last byte and as the first event.
fn check_stall<F: Known, const N: usize>(stream: &[u8], frame: &[u8]) {
    let mut line = Line::<F, N>::new();
    line.slice(stream);
    loop {
        let before = line.decoder().pending();
        assert!(before < F::MAX_LEN);
        line.idle();
        line.slice(&[]);
        if before == 0 {
            break;
        }
        assert!(line.decoder().pending() < before, "an idle line ends nothing");
    }
    let seen = line.events().len();
    line.slice(frame);
    assert_eq!(line.events().len() - seen, oracle::answer(F::RULES, frame, &[]).events.len());
    line.finish();
}

thread_local! {
    static JUDGED: Cell<u64> = const { Cell::new(0) };
    static CHECKED: Cell<u64> = const { Cell::new(0) };
}

/// Another framing that counts how often it is asked, and how often about a whole candidate.
struct Counted<F>(F);

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

/// A checksum is computed once for every place where a candidate starts, and again at most twice
/// for a frame: when a gap is reported in front of it, and when it is read where it lies. Short
/// looks are a few for each byte and for each call.
fn check_work<F: Known, const N: usize>(stream: &[u8], ops: &[Op]) {
    JUDGED.set(0);
    CHECKED.set(0);
    let calls = Line::<Counted<F>, N>::new().play(stream, ops);
    let bytes = stream.len() as u64;
    let frames = bytes / 4;
    assert!(CHECKED.get() <= bytes + 2 * frames, "{} of {bytes} bytes", CHECKED.get());
    assert!(JUDGED.get() <= 6 * bytes + 3 * calls, "{} for {bytes} bytes", JUDGED.get());
}

// Stories.

/// An event with the frame's bytes in it.
#[derive(Debug, PartialEq)]
enum Seen {
    Frame(Vec<u8>),
    Gap(u64, Reason),
}

/// What a decoder with the smallest buffer makes of `chunks`, then of a quiet line.
fn seen<F: Known, const N: usize>(chunks: &[&[u8]], quiet: bool) -> (Vec<Seen>, usize) {
    let mut decoder = Decoder::<F, N>::new();
    let mut seen = Vec::new();
    let mut drain = |decoder: &mut Decoder<F, N>, mut chunk: &[u8]| {
        while let Some(event) = decoder.decode(&mut chunk) {
            seen.push(match event {
                Event::Frame(frame) => Seen::Frame(F::bytes(&frame).to_vec()),
                Event::Skipped(Gap { len, reason }) => Seen::Gap(len, reason),
            });
        }
    };
    for chunk in chunks {
        drain(&mut decoder, chunk);
    }
    if quiet {
        decoder.idle();
        drain(&mut decoder, &[]);
    }
    (seen, decoder.pending())
}

fn read() -> Vec<u8> {
    ikeya::ReadRequest::new(NodeId::N1).as_bytes().to_vec()
}

fn write() -> Vec<u8> {
    ikeya::WriteRequest::velocity(NodeId::N2, Rps::new(1.0).unwrap()).as_bytes().to_vec()
}

fn response() -> Vec<u8> {
    ikeya::VelocityResponse::new(NodeId::N2, Rps::new(1.0).unwrap()).as_bytes().to_vec()
}

fn motor() -> Vec<u8> {
    MotorControl::new(60, 20).unwrap().frame(7).as_bytes().to_vec()
}

#[test]
fn a_false_header_swallows_nothing() {
    let stream = [&[0x55][..], &response(), &response()].concat();
    let (seen, pending) = seen::<ikeya::ToMaster, 8>(&[&stream], false);
    let gap = Seen::Gap(1, Reason::Crc);
    assert_eq!(seen, [gap, Seen::Frame(response()), Seen::Frame(response())]);
    assert_eq!(pending, 0);
}

#[test]
fn a_frame_inside_a_damaged_frame_is_delivered() {
    let mut outer = hostile_streams::ucp_frame_around(0x20, &motor());
    *outer.last_mut().unwrap() ^= 1;
    let (seen, _) = seen::<Ucp, 64>(&[&outer], true);
    let before = Seen::Gap(6, Reason::Crc);
    assert_eq!(seen, [before, Seen::Frame(motor()), Seen::Gap(2, Reason::Header)]);
}

#[test]
fn a_frame_inside_the_payload_of_a_good_one_is_not() {
    let outer = hostile_streams::ucp_frame_around(0x20, &motor());
    let (seen, _) = seen::<Ucp, 64>(&[&outer], true);
    assert_eq!(seen, [Seen::Frame(outer)]);
}

#[test]
fn the_payload_of_a_bad_id_packet_is_not_searched() {
    for id in [0, 9, 255] {
        let packet = hostile_streams::ikeya_packet_around(0xBB, id, &read());
        let (seen, pending) = seen::<ikeya::ToSlave, 8>(&[&packet, &read()], false);
        assert_eq!(seen, [Seen::Gap(8, Reason::Id), Seen::Frame(read())], "id {id}");
        assert_eq!(pending, 0);
    }
}

#[test]
fn a_bad_id_with_a_bad_crc_is_noise() {
    let mut packet = hostile_streams::ikeya_packet_around(0xBB, 9, &read());
    packet[7] ^= 0x80;
    let (seen, _) = seen::<ikeya::ToSlave, 8>(&[&packet], true);
    let (before, after) = (Seen::Gap(2, Reason::Crc), Seen::Gap(2, Reason::Header));
    assert_eq!(seen, [before, Seen::Frame(read()), after]);
}

#[test]
fn a_packet_of_the_other_direction_is_no_header() {
    let stream = [response(), write()].concat();
    let (at_slave, _) = seen::<ikeya::ToSlave, 8>(&[&stream], true);
    assert_eq!(at_slave, [Seen::Gap(8, Reason::Header), Seen::Frame(write())]);
    let (between, _) = seen::<ikeya::Either, 8>(&[&stream], true);
    assert_eq!(between, [Seen::Frame(response()), Seen::Frame(write())]);
}

#[test]
fn boards_with_three_motors_need_their_own_framing() {
    let positions = [Position::new(1, 2), Position::new(3, 4), Position::new(5, 6)];
    let packet = three::PositionResponse::new(NodeId::N8, positions);
    let (with_three, _) = seen::<three::ToMaster, 16>(&[packet.as_bytes()], true);
    assert_eq!(with_three, [Seen::Frame(packet.as_bytes().to_vec())]);
    let (with_one, _) = seen::<ikeya::ToMaster, 8>(&[packet.as_bytes()], true);
    assert_eq!(with_one, [Seen::Gap(16, Reason::Crc)]);
}

#[test]
fn a_doubled_first_sync_byte_hides_no_frame() {
    let stream = [&[0xFD][..], &motor()].concat();
    let single_bytes: Vec<_> = stream.chunks(1).collect();
    for chunks in [&[stream.as_slice()][..], &single_bytes] {
        let (seen, _) = seen::<Ucp, 64>(chunks, false);
        assert_eq!(seen, [Seen::Gap(1, Reason::Header), Seen::Frame(motor())]);
    }
}

#[test]
fn length_61_is_refused_unless_the_cap_is_raised() {
    let longest = hostile_streams::ucp_frame_around(0x20, &[0; 56]);
    let longer = hostile_streams::ucp_frame_around(0x20, &[0; 57]);
    let (by_default, _) = seen::<Ucp, 64>(&[&longest], true);
    assert_eq!(by_default, [Seen::Frame(longest)]);
    let (by_default, _) = seen::<Ucp, 64>(&[&longer], true);
    assert_eq!(by_default, [Seen::Gap(65, Reason::Length)]);
    let (with_cap, _) = seen::<Ucp<61>, 65>(&[&longer], true);
    assert_eq!(with_cap, [Seen::Frame(longer)]);
}

#[test]
fn a_length_that_no_frame_has_stalls_nothing() {
    for len in [0_u16, 3, 61, 253, 0x0100, 0x0104, 0x0400, 0xFFFF] {
        let [low, high] = len.to_le_bytes();
        let (seen, _) = seen::<Ucp, 64>(&[&[0xFD, 0xFF, low, high], &motor()], false);
        assert_eq!(seen, [Seen::Gap(4, Reason::Length), Seen::Frame(motor())], "len {len}");
    }
}

#[test]
fn an_unknown_id_is_delivered() {
    for (id, body) in [(0x20, &[1, 2, 3][..]), (0, &[]), (2, &[0; 15]), (5, &[0; 35])] {
        let frame = hostile_streams::ucp_frame_around(id, body);
        let mut decoder = ucp::Decoder::new();
        let mut input = frame.as_slice();
        let Some(Event::Frame(frame)) = decoder.decode(&mut input) else { panic!("id {id}") };
        let ucp::Message::Unknown(raw) = frame.message() else { panic!("id {id}") };
        assert_eq!((raw.id, raw.index, raw.body), (id, 0, body));
    }
}

#[test]
fn a_truncated_frame_takes_nothing_with_it() {
    for len in 1..motor().len() {
        let stream = [&motor()[..len], &motor(), &motor()].concat();
        let (seen, pending) = seen::<Ucp, 64>(&[&stream], false);
        assert_eq!(seen.len(), 3, "cut to {len}");
        assert_eq!(seen[1..], [Seen::Frame(motor()), Seen::Frame(motor())], "cut to {len}");
        assert_eq!(pending, 0);
    }
}

#[test]
fn one_gap_is_one_event_with_the_reason_of_its_first_byte() {
    // A false header with a wrong CRC, stray bytes, a packet for node 9.
    let stranger = hostile_streams::ikeya_packet_around(0xBB, 9, &[0; 4]);
    let stream = [&[0xAA, 0x00, 0x00][..], &stranger, &read()].concat();
    let (gap_first, _) = seen::<ikeya::ToSlave, 8>(&[&stream], false);
    assert_eq!(gap_first, [Seen::Gap(11, Reason::Crc), Seen::Frame(read())]);
    // Each byte is still counted under its own reason.
    let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
    let mut input = stream.as_slice();
    while decoder.decode(&mut input).is_some() {}
    let counters = decoder.counters();
    let by_reason = [counters.header, counters.length, counters.id, counters.crc, counters.idle];
    assert_eq!((by_reason, counters.gaps), ([2, 0, 8, 1, 0], 1));
}

#[test]
fn the_longest_false_header_delays_a_frame_by_at_most_a_longest_frame() {
    // A frame of 64 bytes is promised; then motor commands of 24 come.
    let header = [0xFD, 0xFF, 60, 0];
    let mut line = Line::<Ucp, 64>::new();
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
    // Its rest comes after all.
    let mut line = Line::<Ucp, 64>::new();
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
    let mut line = Line::<ikeya::ToSlave, 64>::new();
    line.commit(&[&read()[..], &write(), &read()[..2]].concat());
    line.idle();
    line.slice(&[]);
    let idle = oracle::Event::Skipped { offset: 12, len: 2, reason: oracle::Reason::Idle };
    assert_eq!(line.events().len(), 3);
    assert_eq!(line.events().last(), Some(&idle));
    line.finish();
}

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

/// A framing that breaks its contract: a frame longer than the bytes, a candidate that needs nothing,
/// a refusal of more than there is.
struct Liar<const LIE: u8>;

impl<const LIE: u8> Framing for Liar<LIE> {
    type Frame<'a> = &'a [u8];
    const MIN_LEN: usize = 1;
    const MAX_LEN: usize = 4;

    fn judge(bytes: &[u8]) -> Verdict {
        match LIE {
            _ if bytes.is_empty() => Verdict::Partial { need: 1 },
            0 => Verdict::Frame { len: bytes.len() + 1 },
            1 => Verdict::Partial { need: 0 },
            2 => Verdict::Reject { reason: Reason::Crc, more: bytes.len() + 5 },
            _ => Verdict::Partial { need: usize::MAX },
        }
    }

    fn view(frame: &[u8]) -> Option<&[u8]> {
        Some(frame)
    }
}

#[test]
fn a_framing_that_lies_hangs_nothing() {
    fn feed<const LIE: u8>() {
        let mut decoder = Decoder::<Liar<LIE>, 4>::new();
        let mut most = 1000;
        let mut drain = |decoder: &mut Decoder<Liar<LIE>, 4>, mut input: &[u8]| {
            while decoder.decode(&mut input).is_some() || decoder.poll().is_some() {
                most -= 1;
                assert!(most > 0, "lie {LIE} is told for ever");
            }
        };
        drain(&mut decoder, &[1; 10]);
        for byte in 0..9 {
            decoder.push(byte);
            drain(&mut decoder, &[]);
        }
        decoder.spare().fill(3);
        decoder.commit(4);
        drain(&mut decoder, &[4; 3]);
        decoder.idle();
        drain(&mut decoder, &[5; 9]);
        assert!(Frames::<Liar<LIE>>::new(&[6; 9]).take(10).count() <= 1);
    }
    feed::<0>();
    feed::<1>();
    feed::<2>();
    feed::<3>();
}

/// Frames of three bytes that begin with F, but judged only when eight bytes are there.
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
}

#[test]
fn a_copy_of_a_decoder_goes_on_by_itself() {
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
fn a_byte_pushed_into_a_full_buffer_is_not_taken() {
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
fn a_split_candidate_is_judged_no_more_often_than_its_bytes_can_change_the_verdict() {
    let frame = hostile_streams::ucp_frame_around(0x20, &[0; 56]);
    JUDGED.set(0);
    CHECKED.set(0);
    let mut line = Line::<Counted<Ucp>, 64>::new();
    for byte in &frame[..63] {
        line.slice(&[*byte]);
    }
    // One byte, the sync, half a length, a length.
    assert_eq!((JUDGED.get(), CHECKED.get()), (4, 0));
    line.slice(&frame[63..]);
    assert_eq!((line.events().len(), CHECKED.get()), (1, 1));
    line.finish();
}

#[test]
fn no_more_is_committed_than_there_is_room_for() {
    let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
    decoder.commit(usize::MAX);
    assert_eq!((decoder.counters().received, decoder.pending()), (8, 8));
    assert!(decoder.spare().is_empty());
    while decoder.decode(&mut &[][..]).is_some() {}
    assert_eq!((decoder.counters().header, decoder.spare().len()), (8, 8));
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
