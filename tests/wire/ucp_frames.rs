//! Frames: what is parsed, what is encoded, and what is refused with which error.
#![cfg(feature = "ucp")]

use std::collections::BTreeSet;

use axlewire::{crc16, ucp::Header};

use crate::rig::*;

#[test]
fn parsing_one_frame_says_what_is_wrong_with_it() {
    let good = frame(1, 0, &[0]);
    assert_eq!(Frame::parse(&good).unwrap().as_bytes(), good);
    for length in 0..8 {
        let error = ParseError::Length { expected: 8, found: length };
        assert_eq!(Frame::parse(&good[..length]).unwrap_err(), error);
    }
    let error = ParseError::Length { expected: 9, found: 8 };
    assert_eq!(Frame::parse(&good[..8]).unwrap_err(), error);
    let mut long = good.clone();
    long.push(0);
    assert_eq!(Frame::parse(&long).unwrap_err(), ParseError::Length { expected: 9, found: 10 });
    for bit in 0..8 * good.len() {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        let error = Frame::parse(&bad).unwrap_err();
        match bit / 8 {
            0 | 1 => assert_eq!(error, ParseError::Field),
            2 | 3 => assert!(matches!(error, ParseError::Length { found: 9, .. })),
            _ => assert!(matches!(error, ParseError::Crc { .. })),
        }
    }
}

#[test]
fn every_length_field_is_judged_by_the_cap() {
    for length in 0..=u16::MAX {
        let mut bytes = vec![0xFD, 0xFF];
        bytes.extend(length.to_le_bytes());
        bytes.resize(usize::from(length.min(300)) + 2, 0x11);
        let crc = crc16::compute(&bytes);
        bytes.extend(crc.to_le_bytes());
        let default = Frames::<Ucp>::new(&bytes).next().map(|frame| frame.as_bytes().len());
        let wide = Frames::<Ucp<252>>::new(&bytes).next().map(|frame| frame.as_bytes().len());
        let whole = (length <= 300).then_some(bytes.len());
        assert_eq!(default, whole.filter(|_| (4..=60).contains(&length)), "{length}");
        assert_eq!(wide, whole.filter(|_| (4..=252).contains(&length)), "{length}");
        if !(4..=60).contains(&length) {
            let mut frames = Frames::<Ucp>::new(&bytes[..4]);
            assert!(frames.next().is_none());
            assert_eq!(frames.counters().skipped_for(Reason::Length), 1);
        }
    }
}

#[test]
fn a_frame_cast_from_bytes_is_not_sent_under_an_id_that_is_not_its_bodys() {
    use zerocopy::TryFromBytes;
    let mut buffer = [0xEE; 64];
    for id in 0..=u8::MAX {
        let bytes = frame(id, 0, &[]);
        let ping = FrameOf::<Ping>::try_read_from_bytes(&bytes).unwrap();
        if id == 1 {
            assert_eq!(ping.encode(&mut buffer), Ok(&bytes[..]));
            buffer = [0xEE; 64];
        } else {
            assert_eq!(ping.encode(&mut buffer), Err(EncodeError::Header { id, len: 4 }));
            assert_eq!(buffer, [0xEE; 64]);
        }
    }
    // The same for a length field that makes shipped robots overflow.
    let mut long = frame(1, 0, &[]);
    long[2] = 253;
    let ping = FrameOf::<Ping>::try_read_from_bytes(&long).unwrap();
    let error = EncodeError::Header { id: 1, len: 253 };
    assert_eq!(ping.encode(&mut buffer), Err(error));
    assert_eq!(error.to_string(), "header (id 0x01, length 253) does not match its body");
}

#[test]
fn a_raw_frame_with_a_known_id_is_refused_and_any_other_is_sent() {
    for id in 0..=u8::MAX {
        let mut buffer = [0xEE; 16];
        let raw = RawFrame { id, index: 5, body: &[1, 2, 3] };
        match raw.encode(&mut buffer) {
            Ok(bytes) => {
                assert!(!(1..=10).contains(&id));
                let parsed = Frame::parse(bytes).unwrap();
                assert_eq!(parsed.message(), Message::Unknown(raw));
            }
            Err(error) => {
                assert!((1..=10).contains(&id));
                assert_eq!(error, EncodeError::KnownId { id });
                assert_eq!(buffer, [0xEE; 16]);
            }
        }
    }
}

#[test]
fn a_body_above_56_bytes_is_refused_and_56_is_sent() {
    let body = [0x5A; 300];
    let mut buffer = [0; 400];
    let raw = |length| RawFrame { id: 0x30, index: 0, body: &body[..length] };
    for length in 0..=56 {
        let bytes = raw(length).encode(&mut buffer).unwrap();
        assert_eq!(bytes.len(), length + 8);
        assert_eq!(Frames::<Ucp>::new(bytes).next().unwrap().body(), &body[..length]);
    }
    for length in [57, 248, 256, 300] {
        let error = EncodeError::BodyTooLong { length, limit: 56 };
        assert_eq!(raw(length).encode(&mut buffer), Err(error));
    }
}

/// The frames that the receiver of shipped robots (v6.38) takes: it reads 7 bytes, looks for FD FF
/// in them, where a byte other than FF behind FD is not looked at again, reads on as `len` says,
/// and gives a frame up at an id other than 1 to 10 without a search in what it has not read yet.
fn taken_by_a_shipped_robot(stream: &[u8]) -> Vec<&[u8]> {
    let (mut taken, mut at) = (Vec::new(), 0);
    while at < stream.len() {
        let read = &stream[at..stream.len().min(at + 7)];
        let mut sync = 0;
        while sync < read.len() && !read[sync..].starts_with(&[0xFD, 0xFF]) {
            sync += if read[sync] == 0xFD { 2 } else { 1 };
        }
        if sync >= read.len() {
            at += read.len();
            continue;
        }
        let frame = &stream[at + sync..];
        let (Some(&len), Some(id)) = (frame.get(2), frame.get(4)) else { break };
        at += read.len().max(sync + 5);
        if (1..=10).contains(id) {
            let end = (usize::from(len) + 4).min(frame.len());
            at = stream.len() - frame.len() + end;
            taken.extend(Frame::parse(&frame[..end]).is_ok().then_some(&frame[..end]));
        }
    }
    taken
}

#[test]
fn a_raw_frame_hides_no_other_frame_from_shipped_robots() {
    let mut update = [0; 16];
    update[8] = 39; // the version
    for inner in
        [frame(2, 0, &[60; 16]), frame(2, 0, &update), frame(9, 0, &[40, 0]), frame(1, 0, &[])]
    {
        assert_eq!(taken_by_a_shipped_robot(&inner), [&inner[..]], "the model takes it alone");
        let mut is_dangerous = false;
        for pad in 0..=20 {
            let body = [&[0; 20][..pad], &inner].concat();
            let raw = RawFrame { id: 0x2B, index: 3, body: &body };
            is_dangerous |= !taken_by_a_shipped_robot(&frame(0x2B, 0, &body)).is_empty();
            let mut buffer = [0xEE; 64];
            assert_eq!(raw.encode(&mut buffer), Err(EncodeError::NestedHeader { at: 6 + pad }));
            assert_eq!(buffer, [0xEE; 64]);
        }
        assert!(is_dangerous, "without the refusal it would take {inner:?}");
    }
}

/// It goes on with what it has not read yet, 7 bytes at a time, and may read FD FF in two parts. A
/// frame that ends in FD takes the next header with it, and with that the frame behind.
#[test]
fn a_shipped_robot_may_lose_two_stops_behind_a_raw_frame_and_takes_the_third() {
    let stop = MotorControl::STOP.frame(0);
    let mut lost = [Vec::new(), Vec::new()];
    for len in 0..=56 {
        for index in 0..=255 {
            let mut buffer = [0; 64];
            let raw = RawFrame { id: 0x20, index, body: &[0; 56][..len] };
            let Ok(raw) = raw.encode(&mut buffer) else { continue };
            let stream = [raw, &stop.as_bytes().repeat(3)].concat();
            match taken_by_a_shipped_robot(&stream).len() {
                0 => panic!("all three are lost: {raw:02X?}"),
                3 => {}
                taken => lost[2 - taken].push((len, raw[raw.len() - 1])),
            }
        }
    }
    let [one, two] = lost;
    let in_two_parts = one.iter().filter(|(_, last)| *last != 0xFD);
    let lens: BTreeSet<_> = in_two_parts.map(|(len, _)| *len).collect();
    assert_eq!(lens.into_iter().collect::<Vec<_>>(), [5, 12, 19, 26, 33, 40, 47, 54]);
    assert!(!two.is_empty() && two.iter().all(|(_, last)| *last == 0xFD), "{two:?}");
}

#[test]
fn fd_ff_anywhere_behind_the_header_of_a_raw_frame_is_refused() {
    let mut buffer = [0; 64];
    let mut encoded = |id, index, body: &[u8]| {
        RawFrame { id, index, body }.encode(&mut buffer).map(<[u8]>::to_vec)
    };
    assert_eq!(encoded(0xFD, 0xFF, &[]), Err(EncodeError::NestedHeader { at: 4 }));
    assert_eq!(encoded(0x20, 0xFD, &[0xFF]), Err(EncodeError::NestedHeader { at: 5 }));
    let last = [&[0; 54][..], &[0xFD, 0xFF]].concat();
    assert_eq!(encoded(0x20, 0, &last), Err(EncodeError::NestedHeader { at: 60 }));
    for harmless in [&[0xFD, 0xFE][..], &[0xFF, 0xFD], &[0xFD, 0, 0xFF]] {
        encoded(0x20, 0, harmless).unwrap();
    }
    // In the CRC: another index makes another one.
    let has_it_in_crc = |body: &[u8; 2]| frame(0x20, 0, body)[8..] == [0xFD, 0xFF];
    let body = (0..=u16::MAX).map(u16::to_le_bytes).find(has_it_in_crc).unwrap();
    assert_eq!(encoded(0x20, 0, &body), Err(EncodeError::NestedHeader { at: 8 }));
    encoded(0x20, 1, &body).unwrap();
}

#[test]
fn a_buffer_too_small_is_refused_with_both_lengths_and_left_alone() {
    for available in 0..9 {
        let mut buffer = vec![0xEE; available];
        let too_small = EncodeError::BufferTooSmall { needed: 9, available };
        assert_eq!(Pong::new(ErrorCode::Fine).frame(0).encode(&mut buffer), Err(too_small));
        assert_eq!(RawFrame { id: 99, index: 0, body: &[1] }.encode(&mut buffer), Err(too_small));
        assert_eq!(buffer, vec![0xEE; available]);
    }
}

#[test]
fn frames_carry_the_index_of_their_sender() {
    for index in 0..=u8::MAX {
        assert_eq!(Ping {}.frame(index).index(), index);
        let bytes = CalibrationStart::new(CalibrationKind::Imu).frame(index);
        assert_eq!(Frame::parse(bytes.as_bytes()).unwrap().index(), index);
    }
    assert_eq!(Header::LEN, 6);
}

#[test]
fn no_frame_has_an_empty_length_field_even_without_a_body() {
    let ping = Ping {}.frame(7);
    let frame = Frame::parse(ping.as_bytes()).unwrap();
    assert_eq!(
        (frame.header().len(), frame.header().is_empty(), frame.body()),
        (4, false, &[][..])
    );
    assert_eq!((frame.header().id(), frame.header().index()), (1, 7));
}

#[test]
fn a_header_is_empty_if_its_length_is_0() {
    use zerocopy::TryFromBytes;
    for (len, expected) in [([0, 0], true), ([4, 0], false), ([0, 1], false)] {
        let bytes = [0xFD, 0xFF, len[0], len[1], 1, 0];
        let header = Header::try_ref_from_bytes(&bytes).unwrap();
        assert_eq!(header.is_empty(), expected, "{len:?}");
    }
}
