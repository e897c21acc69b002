//! False headers, damage and nested frames: no good frame is lost, none is invented.

use axlewire::{ikeya, ucp};

use crate::rig::*;

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
fn a_packet_of_the_other_direction_is_not_a_header() {
    let stream = [response(), write()].concat();
    let (at_slave, _) = seen::<ikeya::ToSlave, 8>(&[&stream], true);
    assert_eq!(at_slave, [Seen::Gap(8, Reason::Header), Seen::Frame(write())]);
    let (between, _) = seen::<ikeya::BothDirections, 8>(&[&stream], true);
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
