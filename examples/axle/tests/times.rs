//! Captures with times: what `axle decode` makes of pcapng.

mod support;

use axlewire::{
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest},
    ucp::{Body, message::Ping},
};
use serde_json::{Value, json};
use support::{
    events, file,
    pcapng::{Packet, PcapNg, outcome},
    run, stdout,
};

const IKEYA: u16 = 147;
const UCP: u16 = 149;

/// A moment in 2026.
const T: u64 = 1_795_386_000_000_000;

/// A READ, the node's answer in two pieces, and a WRITE.
fn bus() -> PcapNg {
    let node = NodeId::N2;
    let answer = *VelocityResponse::new(node, Rps::new(1.5).unwrap()).as_bytes();
    let write = *WriteRequest::velocity(node, Rps::new(2.0).unwrap()).as_bytes();
    PcapNg::new(
        IKEYA,
        &[
            (T, 2, ReadRequest::new(node).as_bytes()),
            (T + 250, 1, &answer[..3]),
            (T + 1_000_300, 1, &answer[3..]),
            (T + 1_000_400, 2, &write),
        ],
    )
}

fn lines(args: &[&str], input: &[u8]) -> Vec<String> {
    let args = [&["decode"], args].concat();
    stdout(run(&args, input)).lines().map(str::to_owned).collect()
}

/// The time column of each line of frames and gaps.
fn times(args: &[&str], input: &[u8]) -> Vec<String> {
    let lines = lines(args, input);
    let end = lines.iter().position(String::is_empty).unwrap();
    lines[1..end]
        .iter()
        .map(|line| line.split("  ").find(|it| !it.is_empty()).unwrap().trim().to_owned())
        .collect()
}

fn decode(args: &[&str], input: &[u8]) -> (Vec<Value>, Value) {
    let args = [&["decode", "--json"], args].concat();
    events(&stdout(run(&args, input)))
}

#[test]
fn the_time_of_a_frame_is_that_of_its_last_byte() {
    let capture = bus().0;
    assert_eq!(times(&[], &capture), ["0.000000", "1.000300", "1.000400"]);
    assert_eq!(times(&["--time", "delta"], &capture), ["0.000000", "1.000300", "0.000100"]);
    let absolute = times(&["-t", "absolute"], &capture);
    assert_eq!(absolute[1], "2026-11-22T22:20:01.000300Z");
    let none = lines(&["--time", "none"], &capture);
    assert_eq!(none[1], "         0      4  read_request               2");
}

#[test]
fn json_has_seconds_since_1970_and_the_direction_where_it_is_known() {
    let (events, summary) = decode(&[], &bus().0);
    let expected = json!({
        "event": "frame", "offset": 0, "t": 1_795_386_001.000_3, "interface": 0, "direction": "in",
        "length": 8, "protocol": "ikeya", "message": "velocity_response", "node": 2, "rps": 1.5,
        "bytes": "55020000c03f5f7a",
    });
    let mut answer = events[1].clone();
    answer["bytes"] = expected["bytes"].clone();
    assert_eq!(answer, expected);
    assert_eq!(events[0]["direction"], "out");
    // Each direction is a stream of its own: the offsets say so.
    assert_eq!(events[2]["offset"], 4);
    assert_eq!((&summary["received"], &summary["frames"]), (&json!(20), &json!(3)));
    let unknown = PcapNg::new(UCP, &[(T, 0, Ping {}.frame(0).as_bytes())]);
    assert_eq!(decode(&[], &unknown.0).0[0].get("direction"), None);
}

#[test]
fn a_gap_has_the_time_of_its_last_byte() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let packets: [Packet<'_>; 3] = [(T, 1, &[1, 2]), (T + 10, 1, &[3]), (T + 20, 1, &ping)];
    let (events, _) = decode(&[], &PcapNg::new(UCP, &packets).0);
    assert_eq!((&events[0]["length"], &events[0]["t"]), (&json!(3), &json!(1_795_386_000.000_01)));
    assert_eq!(events[1]["t"], json!(1_795_386_000.000_02));
}

#[test]
fn a_write_is_read_as_the_answers_of_its_node_tell() {
    let (one, three) = (NodeId::N1, NodeId::N3);
    let write = |node| *WriteRequest::velocity(node, Rps::new(1.0).unwrap()).as_bytes();
    let speed = *VelocityResponse::new(one, Rps::ZERO).as_bytes();
    let place = *PositionResponse::new(three, Position::new(0, 0)).as_bytes();
    let input = [write(one), speed, write(one), place, write(three)].concat();
    let lines = lines(&["--protocol", "ikeya"], &input);
    assert!(lines[1].ends_with("  1.0 rps or 16256.0000 turns (rotation 16256, count 0)"));
    assert!(lines[3].ends_with("  1.0 rps"), "{lines:?}");
    assert!(lines[5].ends_with("  16256.0000 turns (rotation 16256, count 0)"), "{lines:?}");
    let (events, _) = decode(&["--protocol", "ikeya"], &input);
    let modes: Vec<_> = events.iter().map(|event| event.get("mode")).collect();
    let [velocity, position] = [json!("velocity"), json!("position")];
    assert_eq!(modes, [None, None, Some(&velocity), None, Some(&position)]);
}

#[test]
fn a_capture_that_ends_inside_a_block_gives_all_that_is_there_and_one_line() {
    let capture = bus().0;
    let whole = lines(&[], &capture);
    // The last packet is cut behind its first four bytes, and in its header.
    for (cut, skipped) in [(4 + 12 + 4, true), (4 + 12 + 8 + 4, false)] {
        let cut = &capture[..capture.len() - cut];
        let path = file("cut.pcapng", cut);
        let path = path.to_str().unwrap();
        let (listing, code, error) = outcome(run(&["decode", path], &[]));
        let listing: Vec<_> = listing.lines().collect();
        assert_eq!(listing[..3], whole[..3]);
        assert_eq!(listing.get(3).is_some_and(|line| line.contains("(skipped)")), skipped);
        assert_eq!(code, Some(1));
        let expected =
            format!("axle: {path:?}: the file ends inside the pcapng block at byte 208\n");
        assert_eq!(error, expected);
    }
}

#[test]
fn the_summary_of_a_capture_that_is_cut_off_counts_what_is_there() {
    let capture = bus().0;
    let cut = &capture[..capture.len() - 20];
    for (style, expected) in [("-tnone", "16 bytes received"), ("--json", "\"received\":16,")] {
        let (listing, code, error) = outcome(run(&["decode", style, "-s"], cut));
        assert!(listing.contains(expected), "{listing}");
        assert!(error.contains("ends inside the pcapng block") && code == Some(1), "{error}");
    }
}

#[test]
fn another_link_type_is_named_and_can_be_overruled() {
    let ethernet = PcapNg::new(1, &[(T, 0, Ping {}.frame(0).as_bytes())]).0;
    let (listing, code, error) = outcome(run(&["decode"], &ethernet));
    assert_eq!((&*listing, code), ("", Some(1)));
    let says = "axle: interface 0 (\"tty0\") has link type 1, not one of axle's 147 to 150";
    assert!(error.starts_with(says) && error.lines().count() == 1, "{error}");
    assert_eq!(decode(&["--protocol", "ucp"], &ethernet).0[0]["message"], "ping");
}

#[test]
fn a_clock_that_goes_backwards_is_told_and_is_no_failure() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let packets: [Packet<'_>; 3] = [(T, 1, &ping), (T - 1_500_000, 1, &ping), (T + 5, 1, &ping)];
    let capture = PcapNg::new(UCP, &packets).0;
    assert_eq!(times(&[], &capture), ["0.000000", "-1.500000", "0.000005"]);
    assert_eq!(times(&["-t", "delta"], &capture), ["0.000000", "-1.500000", "1.500005"]);
    assert_eq!(lines(&[], &capture).last().unwrap(), "         1 times the clock went backwards");
    assert_eq!(decode(&[], &capture).1["times_back"], 1);
    assert_eq!(decode(&[], &bus().0).1.get("times_back"), None);
    let at_once: [Packet<'_>; 2] = [(T, 1, &ping), (T, 1, &ping)];
    assert_eq!(decode(&[], &PcapNg::new(UCP, &at_once).0).1.get("times_back"), None);
}

#[test]
fn a_capture_without_a_frame_is_a_failure_unless_it_has_no_bytes() {
    for (packets, expected) in [
        (
            &[(T, 1, &[0; 9][..])][..],
            "axle: no frame in 9 bytes: use --protocol if it is another one\n",
        ),
        (&[(T, 1, &[][..])][..], ""),
        (&[][..], ""),
    ] {
        let (_, code, error) = outcome(run(&["decode"], &PcapNg::new(UCP, packets).0));
        assert_eq!((&*error, code), (expected, Some(i32::from(!expected.is_empty()))));
    }
}

#[test]
fn each_interface_and_each_direction_is_a_stream_of_its_own() {
    let ping = Ping {}.frame(7).as_bytes().to_vec();
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    let mut capture = PcapNg::new(UCP, &[]);
    capture.interface(IKEYA);
    // Frames of three streams, interleaved byte by byte.
    for at in 0..8 {
        capture.packet(0, (T + at, 1, &ping[at as usize..][..1]));
        capture.packet(0, (T + at, 2, &ping[at as usize..][..1]));
        if let Some(byte) = read.get(at as usize) {
            capture.packet(1, (T + at, 1, &[*byte]));
        }
    }
    let (events, summary) = decode(&[], &capture.0);
    let seen: Vec<_> = events
        .iter()
        .map(|event| (event["interface"].as_u64().unwrap(), event["message"].as_str().unwrap()))
        .collect();
    assert_eq!(seen, [(1, "read_request"), (0, "ping"), (0, "ping")]);
    assert_eq!((&summary["frames"], &summary["skipped"]), (&json!(3), &json!(0)));
}

#[test]
fn garbage_behind_the_first_bytes_of_a_pcapng_file_is_one_line() {
    let (listing, code, error) = outcome(run(&["decode"], b"\n\r\r\nnot really a capture"));
    assert_eq!((&*listing, code), ("", Some(1)));
    assert!(
        error.starts_with("axle: \"standard input\": invalid pcapng block at byte 0"),
        "{error}"
    );
    // Raw bytes that only begin like one.
    let (_, code, _) = outcome(run(&["decode", "--protocol", "ucp"], b"\n\r\r"));
    assert_eq!(code, Some(1));
}

/// A capture of these interfaces and packets: interface and bytes.
fn of_lines(link_types: &[u16], packets: &[(u32, &[u8])]) -> Vec<u8> {
    let (first, others) = link_types.split_first().unwrap();
    let mut capture = PcapNg::new(*first, &[]);
    for link_type in others {
        capture.interface(*link_type);
    }
    for (at, (interface, bytes)) in packets.iter().enumerate() {
        capture.packet(*interface, (T + at as u64, 0, bytes));
    }
    capture.0
}

#[test]
fn the_nodes_of_each_line_have_modes_of_their_own() {
    let node = NodeId::N1;
    let write = *WriteRequest::velocity(node, Rps::new(1.0).unwrap()).as_bytes();
    let speed = *VelocityResponse::new(node, Rps::ZERO).as_bytes();
    let place = *PositionResponse::new(node, Position::new(0, 0)).as_bytes();
    let packets: [(u32, &[u8]); 5] =
        [(0, &speed), (0, &write), (1, &place), (0, &write), (1, &write)];
    let (events, _) = decode(&[], &of_lines(&[IKEYA, IKEYA], &packets));
    let modes: Vec<_> = events.iter().map(|event| event["mode"].as_str()).collect();
    assert_eq!(modes, [None, Some("velocity"), None, Some("velocity"), Some("position")]);
    // The two directions of a line have the same nodes, those of another recording do not.
    let mut capture = PcapNg::new(IKEYA, &[(T, 1, &speed), (T, 2, &write)]).0;
    capture.extend(PcapNg::new(IKEYA, &[(T, 2, &write)]).0);
    let (events, _) = decode(&[], &capture);
    let modes: Vec<_> = events.iter().map(|event| event["mode"].as_str()).collect();
    assert_eq!(modes, [None, Some("velocity"), None]);
}

#[test]
fn one_direction_of_a_bus_can_be_chosen_in_a_capture_too() {
    let answer = *VelocityResponse::new(NodeId::N2, Rps::ZERO).as_bytes();
    let line = [ReadRequest::new(NodeId::N2).as_bytes(), &answer[..]].concat();
    let capture = of_lines(&[IKEYA], &[(0, &line)]);
    for (direction, expected) in [("to-slave", "read_request"), ("to-master", "velocity_response")]
    {
        let (events, summary) = decode(&["--direction", direction], &capture);
        let frames = events.iter().filter(|event| event["event"] == "frame");
        let names: Vec<_> = frames.map(|frame| frame["message"].clone()).collect();
        assert_eq!(names, [expected]);
        assert_eq!(summary["received"], 12);
    }
}

#[test]
fn a_direction_is_refused_where_the_protocol_turns_out_to_be_ucp() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let read = *ReadRequest::new(NodeId::N2).as_bytes();
    let says = "axle: --direction is for ikeya and ikeya-3: UCP frames show their own direction\n";
    for input in [&ping, &of_lines(&[UCP], &[(0, &ping)])] {
        let found = outcome(run(&["decode", "-d", "to-slave"], input));
        assert_eq!(found, (String::new(), Some(2), says.to_owned()));
    }
    // What was decoded before is not lost.
    let mixed = of_lines(&[IKEYA, UCP], &[(0, &read), (1, &ping)]);
    let (listing, code, error) = outcome(run(&["decode", "-d", "to-slave"], &mixed));
    assert!(listing.contains("read_request"), "{listing}");
    assert_eq!((code, &*error), (Some(2), says));
}

#[test]
fn what_precedes_an_interface_of_another_link_type_is_printed() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let capture = of_lines(&[UCP, 1], &[(0, &ping), (0, &ping[..3]), (1, &[1, 2, 3])]);
    for style in ["--json", "--time=none"] {
        let (listing, code, error) = outcome(run(&["decode", style], &capture));
        assert!(listing.contains("ping") && listing.contains("skipped"), "{listing}");
        assert!(!listing.contains("summary") && !listing.contains("received"), "{listing}");
        let says = "axle: interface 1 (\"tty0\") has link type 1, ";
        assert!(error.starts_with(says) && error.lines().count() == 1, "{error}");
        assert_eq!(code, Some(1));
    }
}

#[test]
fn packets_in_obsolete_blocks_are_decoded() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let mut capture = PcapNg::new(UCP, &[]);
    let times = [((T >> 32) as u32).to_le_bytes(), (T as u32).to_le_bytes()].concat();
    capture.block(2, &[&[0; 4][..], &times, &[8, 0, 0, 0, 8, 0, 0, 0], &ping].concat());
    let (events, summary) = decode(&[], &capture.0);
    assert_eq!((&events[0]["message"], &events[0]["t"]), (&json!("ping"), &json!(T as f64 / 1e6)));
    assert_eq!(summary["frames"], 1);
}

#[test]
fn a_pause_ends_no_frame_but_the_end_of_a_section_does() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let whole = PcapNg::new(UCP, &[(T, 1, &ping[..3]), (T + 60_000_000, 1, &ping[3..])]).0;
    assert_eq!(decode(&[], &whole).1["frames"], 1);
    let halves = [&ping[..3], &ping[3..]].map(|half| PcapNg::new(UCP, &[(T, 1, half)]).0);
    let (events, summary) = decode(&["-P", "ucp"], &[&halves[0][..], &halves[1], &whole].concat());
    let lines: Vec<_> =
        events.iter().map(|event| (&event["interface"], &event["length"])).collect();
    let expected = [(0, 3), (1, 5), (2, 8)].map(|(interface, len)| (json!(interface), json!(len)));
    assert_eq!(lines, expected.each_ref().map(|(interface, len)| (interface, len)));
    assert_eq!((&summary["frames"], &summary["received"]), (&json!(1), &json!(16)));
}
