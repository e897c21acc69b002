//! `axle decode` lists the contents of a byte stream.

mod support;

use core::time::Duration;
use std::{
    io::{BufRead, BufReader, Write},
    process::Stdio,
    sync::mpsc,
    thread,
};

use axlewire::{
    ikeya::{NodeId, Rps, VelocityResponse},
    ucp::{Body, message::Ping},
};
use serde_json::{Value, json};
use support::{Capture, axle, bytes, decode, file, run, run_in_pieces, skipped_by, stdout};

/// Frames of running implementations, and their meaning.
fn vectors(name: &str) -> Vec<Value> {
    let path = format!("{}/../../tests/vectors/{name}.jsonl", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let vectors: Vec<_> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(vectors.len() > 80, "the vectors are missing");
    vectors
}

fn hex(vector: &Value) -> &str {
    vector["hex"].as_str().unwrap()
}

/// Our name for a vector's UCP message; the vectors use one name for both directions.
fn message(fields: &Value) -> &'static str {
    match (fields["name"].as_str().unwrap(), fields["len"].as_u64().unwrap() - 4) {
        ("keep_alive", 0) => "ping",
        ("keep_alive", 1) => "pong",
        ("motor_ctl", 16) => "motor_control",
        ("imu_correction_start", 1) => "calibration_start",
        ("imu_correction_start", 2) => "calibration_start_ack",
        ("imu_correction_end", 1) => "calibration_end",
        ("imu_correction_end", 2) => "calibration_end_ack",
        ("report", 34 | 36) => "report",
        ("imu_write", 12) => "imu_bias",
        ("imu_write", 1) => "imu_bias_ack",
        ("mag_write", 6) => "mag_bias",
        ("mag_write", 1) => "mag_bias_ack",
        ("imumag_read", 0) => "bias_request",
        ("imumag_read", 19) => "biases",
        ("ota", 2) => "ota_request",
        ("ota", 1) => "ota_ack",
        ("state", 1 | 4) => "network_state",
        _ => "unknown",
    }
}

#[test]
fn ucp_frames_say_what_running_implementations_mean() {
    const ABOUT_THE_VECTOR: [&str; 6] =
        ["name", "len", "inputs", "note", "stm_v638_parser", "go_reader_accepts"];

    for vector in vectors("ucp") {
        let fields = &vector["fields"];
        let input = bytes(hex(&vector));
        let (events, summary) = decode(&["--protocol", "ucp"], &input);

        let length = fields["len"].as_u64().unwrap() + 4;
        let mut expected = json!({
            "event": "frame", "offset": 0, "length": length, "protocol": "ucp",
            "message": message(fields), "bytes": &hex(&vector)[..2 * length as usize],
        });
        for (name, value) in fields.as_object().unwrap() {
            match (&**name, value.as_str()) {
                ("layout", Some("firmware-36")) => expected["layout"] = "firmware".into(),
                ("layout", Some("wiki-34")) => expected["layout"] = "document".into(),
                ("trailing_bytes", _) => {}
                (name, _) if ABOUT_THE_VECTOR.contains(&name) => {}
                (name, _) => expected[name] = value.clone(),
            }
        }
        assert_eq!(events[0], expected, "{vector}");

        let trailing = input.len() as u64 - length;
        assert_eq!(trailing > 0, fields.get("trailing_bytes").is_some());
        let gap =
            json!({"event": "skipped", "offset": length, "length": trailing, "reason": "header"});
        assert_eq!(events[1..], [gap][..usize::from(trailing > 0)]);
        assert_eq!((&summary["framed"], &summary["frames"]), (&json!(length), &json!(1)));
    }
}

#[test]
fn ikeya_packets_say_what_running_implementations_mean() {
    let mut refused = 0;
    for vector in vectors("ikeya") {
        let (fields, input) = (&vector["fields"], bytes(hex(&vector)));
        let protocol = if vector["protocol"] == "ikeya-md" { "ikeya" } else { "ikeya-3" };
        let direction = if vector["dir"] == "master->slave" { "to-slave" } else { "to-master" };
        let one_way = decode(&["--protocol", protocol, "--direction", direction], &input);
        let (events, summary) = decode(&["--protocol", protocol], &input);
        assert_eq!((&events, &summary), (&one_way.0, &one_way.1));

        let id = fields["id"].as_u64().unwrap();
        let reason = if fields["crc_ok"] == false {
            "crc"
        } else if ![0xAA, 0xBB, 0x55, 0x56].contains(&input[0]) {
            "header"
        } else if !(1..=8).contains(&id) {
            "id"
        } else {
            ""
        };
        if !reason.is_empty() {
            refused += 1;
            let mut gap = json!({
                "event": "skipped", "offset": 0, "length": input.len(), "reason": reason,
            });
            // Header bytes inside it fail as well, or are cut off by the end.
            if let Some(reasons) = events[0].get("reasons") {
                gap["reasons"] = reasons.clone();
            }
            assert_eq!(events, [gap], "{vector}");
            assert_eq!(skipped_by(&events), summary["skipped_by"]);
            assert_eq!(summary["skipped"], input.len());
            continue;
        }

        let [frame] = &*events else { panic!("{vector} gives {events:?}") };
        let name = match input[0] {
            0xAA => "read_request",
            0xBB => "write",
            0x55 => "velocity_response",
            _ => "position_response",
        };
        let has = json!({
            "event": "frame", "offset": 0, "length": input.len(), "protocol": protocol,
            "message": name, "node": id, "bytes": hex(&vector),
        });
        for (field, value) in has.as_object().unwrap() {
            assert_eq!(&frame[field], value, "{field} of {vector}");
        }
        for field in ["count", "rotation"] {
            if let Some(value) = fields.get(field) {
                assert_eq!(&frame[field], value, "{field} of {vector}");
            }
        }
        if let Some(bits) = fields.get("rps_bits") {
            assert_same_speeds(&frame["rps"], bits, &fields["rps"]);
        }
        let payload = (name == "write").then(|| &hex(&vector)[4..hex(&vector).len() - 4]);
        assert_eq!(frame["payload"].as_str(), payload);
        let keys = match name {
            "read_request" => 7,
            "velocity_response" => 8,
            "position_response" => 9,
            _ => 11,
        };
        assert_eq!(frame.as_object().unwrap().len(), keys, "{frame}");
    }
    assert_eq!(refused, 10);
}

/// Compares bit for bit, except that all NaNs are equal; arrays of speeds element by element.
fn assert_same_speeds(found: &Value, bits: &Value, expected: &Value) {
    if let Value::Array(found) = found {
        assert_eq!(found.len(), 3);
        for (at, found) in found.iter().enumerate() {
            assert_same_speeds(found, &bits[at], &expected[at]);
        }
        return;
    }
    let bits = u32::from_str_radix(bits.as_str().unwrap(), 16).unwrap();
    match found {
        Value::String(_) => {
            assert_eq!(found, expected);
            assert!(!f32::from_bits(bits).is_finite());
        }
        _ => assert_eq!((found.as_f64().unwrap() as f32).to_bits(), bits, "{found}"),
    }
}

#[test]
fn a_speed_has_no_more_digits_than_it_needs() {
    let packet = VelocityResponse::new(NodeId::N1, Rps::new(0.1).unwrap());
    let listing = stdout(run(&["decode", "--protocol", "ikeya", "--json"], packet.as_bytes()));
    assert_eq!(
        listing.lines().next().unwrap(),
        r#"{"event":"frame","offset":0,"length":8,"protocol":"ikeya","message":"velocity_response","node":1,"rps":0.1,"bytes":"5501cdcccc3d5b9c"}"#
    );
}

#[test]
fn the_direction_decides_what_is_a_frame() {
    // READ for node 1, velocity response from node 2.
    let input = bytes("aa01bed0 55020000803f540e");
    let messages = |args: &[&str]| {
        let (events, _) = decode(args, &input);
        events.iter().map(|event| (event["message"].clone(), event["reason"].clone())).collect()
    };
    let both: Vec<(Value, Value)> = messages(&["--protocol", "ikeya"]);
    let to_slave: Vec<_> = messages(&["--protocol", "ikeya", "--direction", "to-slave"]);
    let to_master: Vec<_> = messages(&["--protocol", "ikeya", "--direction", "to-master"]);

    let (read, velocity) = (json!("read_request"), json!("velocity_response"));
    let (header, none) = (json!("header"), Value::Null);
    assert_eq!(both, [(read.clone(), none.clone()), (velocity.clone(), none.clone())]);
    assert_eq!(to_slave, [(read, none.clone()), (none.clone(), header.clone())]);
    assert_eq!(to_master, [(none.clone(), header), (velocity, none)]);
}

#[test]
fn events_tile_the_input_and_add_up() {
    let mut input = Vec::new();
    for (at, vector) in vectors("ucp").iter().chain(&vectors("ikeya")).enumerate() {
        input.extend(bytes(hex(vector)));
        input.extend([0xFD, 0xAA, 0x55, 0xFF, 0x00].iter().cycle().skip(at).take(at % 7));
    }
    let lines: [&[&str]; 5] = [
        &["--protocol", "ucp"],
        &["--protocol", "ikeya"],
        &["--protocol", "ikeya-3"],
        &["--protocol", "ikeya", "--direction", "to-slave"],
        &["--protocol", "ikeya-3", "--direction", "to-master"],
    ];
    for line in lines {
        let (events, summary) = decode(line, &input);
        let (mut end, mut framed, mut skipped, mut frames) = (0, 0, 0, 0);
        let mut after_gap = false;
        for event in &events {
            assert_eq!(event["offset"], end, "{event}");
            let length = event["length"].as_u64().unwrap();
            assert!(length > 0);
            end += length;
            if event["event"] == "frame" {
                (framed, frames, after_gap) = (framed + length, frames + 1, false);
            } else {
                assert_eq!(event["event"], "skipped");
                assert!(!after_gap, "consecutive gaps are printed as one: {event}");
                (skipped, after_gap) = (skipped + length, true);
            }
        }
        assert!(frames > 3 && skipped > 0, "{line:?} covers too little");
        assert_eq!(end, input.len() as u64);
        assert_eq!(
            summary,
            json!({
                "event": "summary", "received": end, "framed": framed, "skipped": skipped,
                "pending": 0, "frames": frames, "skipped_by": skipped_by(&events),
            })
        );
    }
}

#[test]
fn each_reason_has_its_name() {
    let reason = |protocol: &str, hex: &str| {
        let (events, _) = decode(&["--protocol", protocol], &bytes(hex));
        assert_eq!(events.len(), 1);
        events[0]["reason"].as_str().unwrap().to_owned()
    };
    assert_eq!(reason("ucp", "00 01"), "header");
    assert_eq!(reason("ucp", "fd ff 3d 00"), "length");
    assert_eq!(reason("ikeya", "aa 09 bf 16"), "id");
    assert_eq!(reason("ikeya", "aa 01 be d1"), "crc");
    assert_eq!(reason("ucp", "fd ff 04 00 01"), "idle");
}

#[test]
fn a_frame_behind_a_false_header_at_the_end_is_not_lost() {
    // Two headers that announce 64 bytes, a ping, and the start of another one.
    let input = bytes("fdff3c00 fdff3c00 fdff040001000142 fdff0400");
    let (events, summary) = decode(&["--protocol", "ucp"], &input);
    assert_eq!(
        events,
        [
            // Two gaps, printed as one.
            json!({
                "event": "skipped", "offset": 0, "length": 8, "reason": "idle",
                "reasons": {"idle": 2, "header": 6},
            }),
            json!({
                "event": "frame", "offset": 8, "length": 8, "protocol": "ucp",
                "message": "ping", "id": 1, "index": 0, "bytes": "fdff040001000142",
            }),
            json!({
                "event": "skipped", "offset": 16, "length": 4, "reason": "idle",
                "reasons": {"idle": 1, "header": 3},
            }),
        ]
    );
    assert_eq!((&summary["pending"], &summary["skipped"]), (&json!(0), &json!(12)));
    assert_eq!(summary["skipped_by"], json!({"idle": 3, "header": 9}));
}

#[test]
fn the_reasons_of_each_gap_are_its_own() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    // A length that no frame has, and bytes that begin none: two reasons in each gap.
    let gap = [&[0xFD, 0xFF, 200, 0][..], &[1; 5]].concat();
    let (events, summary) = decode(&["-P", "ucp"], &[&ping[..], &gap, &ping, &gap, &ping].concat());
    let gaps: Vec<_> = events.iter().filter(|event| event["event"] == "skipped").collect();
    assert_eq!((gaps.len(), &gaps[0]["reasons"]), (2, &gaps[1]["reasons"]));
    assert_eq!(skipped_by(&events), summary["skipped_by"]);
    assert!(summary["skipped_by"]["length"].as_u64().unwrap() > 0, "{summary}");
}

#[test]
fn the_protocol_of_a_short_input_is_found_behind_a_false_header() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let input = [&[0xFD, 0xFF, 60, 0][..], &ping].concat();
    let (events, summary) = decode(&[], &input);
    assert_eq!((&events[0]["event"], &events[0]["protocol"]), (&json!("protocol"), &json!("ucp")));
    assert_eq!(summary["frames"], 1);
}

#[test]
fn where_the_beginning_tells_no_protocol_the_option_is_named() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let late = [&[0; 70_000][..], &ping].concat();
    let stderr = String::from_utf8(run(&["decode"], &late).stderr).unwrap();
    assert!(stderr.starts_with("axle: no frame of any protocol in the first "), "{stderr}");
    assert!(stderr.ends_with(" bytes: use --protocol to decode them all\n"), "{stderr}");
    assert_eq!(decode(&["-P", "ucp"], &late).1["frames"], 1);
    // In the first 64 KiB it is found, however slowly they come.
    let (piped, args) = (Stdio::piped, ["decode", "--json"]);
    let mut child = axle(&args).stdin(piped()).stdout(piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    for piece in [&[0; 2000][..], &ping] {
        stdin.write_all(piece).unwrap();
        thread::sleep(Duration::from_millis(300));
    }
    drop(stdin);
    let found = stdout(child.wait_with_output().unwrap());
    assert!(found.starts_with(r#"{"event":"protocol","protocol":"ucp""#), "{found}");
    // All of a short input has been looked at.
    let stderr = String::from_utf8(run(&["decode"], &[0; 70]).stderr).unwrap();
    assert_eq!(stderr, "axle: no frame of any protocol in the first 70 bytes\n");
}

#[test]
fn without_a_frame_the_protocol_that_has_some_is_named() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let complaint = |protocol: &str, input: &[u8]| {
        String::from_utf8(run(&["decode", "--protocol", protocol], input).stderr).unwrap()
    };
    assert_eq!(
        complaint("ikeya", &ping),
        format!("axle: no ikeya frame in {} bytes, but 1 of ucp: use --protocol ucp\n", ping.len())
    );
    let plain = "no ucp frame in 9 bytes: the wrong protocol, the wrong baud rate, or noise";
    assert_eq!(complaint("ucp", &[0; 9]), format!("axle: {plain}\n"));
}

#[test]
fn chunk_boundaries_change_nothing() {
    const CHUNK_LEN: u64 = 64 * 1024;
    let capture = Capture::noisy(6 * CHUNK_LEN as usize, 0x9E37_79B9_7F4A_7C15);
    let split = capture.events.iter().filter(|event| {
        let offset = event["offset"].as_u64().unwrap();
        let last = offset + event["length"].as_u64().unwrap() - 1;
        event["event"] == "frame" && offset / CHUNK_LEN != last / CHUNK_LEN
    });
    assert!(split.count() >= 3, "no frame crosses a boundary");

    let path = file("chunks.bin", &capture.bytes);
    let args = ["decode", "--json", "--protocol", "ucp", path.to_str().unwrap()];
    let (found, summary) = support::events(&stdout(run(&args, &[])));
    for (found, expected) in found.iter().zip(&capture.events) {
        assert_eq!(found, expected);
    }
    assert_eq!(found.len(), capture.events.len());
    assert_eq!(summary["received"], capture.bytes.len());
    assert_eq!(summary["skipped_by"], skipped_by(&capture.events));
}

#[test]
fn a_file_and_standard_input_give_the_same_output() {
    let capture = Capture::noisy(150_000, 42);
    let path = file("same.bin", &capture.bytes);
    for style in [&["--json"][..], &[]] {
        let args = [&["decode", "--protocol", "ucp"], style].concat();
        let from_file = stdout(run(&[&args[..], &[path.to_str().unwrap()]].concat(), &[]));
        assert!(from_file.lines().count() > capture.events.len());
        assert!(from_file == stdout(run(&args, &capture.bytes)), "no FILE");
        assert!(from_file == stdout(run(&[&args[..], &["-"]].concat(), &capture.bytes)), "-");
        assert!(from_file == stdout(run_in_pieces(&args, &capture.bytes, 997)), "in pieces");
    }
}

#[test]
fn a_live_line_is_listed_as_it_speaks() {
    let mut child = axle(&["decode", "--protocol", "ucp", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (heard, listing) = mpsc::channel();
    let output = BufReader::new(child.stdout.take().unwrap());
    let listener = thread::spawn(move || {
        output.lines().map_while(Result::ok).for_each(|line| heard.send(line).unwrap());
    });

    let mut line = child.stdin.take().unwrap();
    for index in 0..3 {
        line.write_all(Ping {}.frame(index).as_bytes()).unwrap();
        let event = listing.recv().unwrap();
        assert!(event.contains(&format!(r#""index":{index},"#)), "{event}");
    }
    drop(line);
    assert!(listing.recv().unwrap().contains("summary"));
    listener.join().unwrap();
    assert!(child.wait().unwrap().success());
}

#[test]
fn an_empty_input_is_all_zeros() {
    let path = file("empty.bin", &[]);
    let args = ["decode", "--protocol", "ucp", path.to_str().unwrap()];
    assert_eq!(stdout(run(&args, &[])), "The input is empty: 0 bytes received, 0 frames.\n");

    let (events, summary) = decode(&["--protocol", "ikeya"], &[]);
    assert!(events.is_empty());
    assert_eq!(
        summary,
        json!({
            "event": "summary", "received": 0, "framed": 0, "skipped": 0, "pending": 0,
            "frames": 0, "skipped_by": {},
        })
    );
}
