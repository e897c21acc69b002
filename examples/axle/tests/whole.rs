//! Whole files: several threads give the same output, the protocol is found out, and the summary
//! alone.

mod support;

use axlewire::{
    encode::Encode,
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest},
};
use support::{Capture, axle, file, pcapng::outcome, run, stdout};

/// Output, exit code and error line.
fn decode(args: &[&str], path: &str) -> (String, Option<i32>, String) {
    outcome(axle(&[&["decode"], args, &[path]].concat()).output().unwrap())
}

/// A bus whose nodes change their modes, with damage.
fn bus(len: usize) -> Vec<u8> {
    let (mut bytes, mut at) = (Vec::new(), 0_u32);
    while bytes.len() < len {
        at += 1;
        let node = NodeId::ALL[at as usize * 7 % 8];
        let begin = bytes.len();
        bytes.extend(ReadRequest::new(node).as_bytes());
        if at / 1000 % 2 == u32::from(node.get()) % 2 {
            let rps = Rps::new(at as f32 * 0.01).unwrap();
            bytes.extend(VelocityResponse::new(node, rps).as_bytes());
            bytes.extend(WriteRequest::velocity(node, rps).as_bytes());
        } else {
            let place = Position::new(at as i16, 3);
            bytes.extend(PositionResponse::new(node, place).as_bytes());
            bytes.extend(WriteRequest::position(node, place).as_bytes());
        }
        if at % 13 == 0 {
            bytes[begin + at as usize % 20] ^= 0x40;
        }
        if at % 17 == 0 {
            bytes.truncate(bytes.len() - at as usize % 5);
        }
    }
    bytes
}

#[test]
fn any_number_of_threads_gives_the_same_output_byte_for_byte() {
    let mut quiet = Capture::noisy(60_000, 3).bytes;
    // Longer than the longest part: no place to split.
    quiet.resize(quiet.len() + 5_000_000, 0);
    quiet.extend(Capture::noisy(60_000, 4).bytes);
    let inputs = [
        ("ucp", Capture::noisy(250_000, 1).bytes),
        ("ikeya", bus(50_000)),
        ("ucp", quiet),
        // Cut off in the middle of a frame; shorter than a part; nothing.
        ("ikeya", bus(40_000)[..39_999].to_vec()),
        ("ikeya", bus(100)),
        ("ucp", Vec::new()),
        // Not a frame anywhere.
        ("ucp", vec![0xFD; 100_000]),
        ("ikeya-3", bus(50_000)),
    ];
    for (at, (protocol, bytes)) in inputs.iter().enumerate() {
        let path = file(&format!("whole-{at}.bin"), bytes);
        let path = path.to_str().unwrap();
        for style in ["--json", "--time=none", "--summary", "--json --summary"] {
            let mut args = vec!["--protocol", protocol];
            args.extend(style.split(' '));
            let one = decode(&[&args[..], &["--jobs", "1"]].concat(), path);
            // Standard input is decoded in chunks by another path.
            let piped = run(&[&["decode"], &args[..]].concat(), bytes);
            assert!(outcome(piped).0 == one.0, "{protocol} {style} piped");
            for jobs in ["2", "16"] {
                let more = decode(&[&args[..], &["--jobs", jobs]].concat(), path);
                assert!(more == one, "{at} {protocol} {style} --jobs {jobs}");
            }
            assert!(decode(&args, path) == one, "{protocol} {style} by default");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_account_of_a_long_file() {
    // Long enough for threads that read the file themselves; the second ends in the middle of a
    // frame, the third has no place to split in a part of it.
    let mut gap = bus(900_000);
    gap.extend(vec![0x55; 600_000]);
    gap.extend(bus(300_000));
    let inputs = [
        ("ucp", Capture::noisy(1_200_000, 5).bytes),
        ("ikeya", bus(1_500_000)[..1_499_997].to_vec()),
        ("ikeya", gap),
    ];
    for (at, (protocol, bytes)) in inputs.iter().enumerate() {
        let path = file(&format!("long-{at}.bin"), bytes);
        let path = path.to_str().unwrap();
        let args = ["--protocol", protocol, "--json", "--summary"];
        let one = decode(&[&args[..], &["--jobs", "1"]].concat(), path);
        assert!(one.0.contains(&format!("\"received\":{},", bytes.len())), "{}", one.0);
        for jobs in ["2", "3", "16"] {
            assert_eq!(decode(&[&args[..], &["--jobs", jobs]].concat(), path), one, "{at} {jobs}");
        }
    }
}

#[test]
fn a_file_that_cannot_be_read_to_its_end_is_listed_as_far_as_it_goes() {
    // Reading a directory entry of a process fails at once; standard output has nothing.
    if cfg!(target_os = "linux") {
        let (listing, code, error) =
            decode(&["--protocol", "ucp", "--jobs", "4"], "/proc/self/mem");
        assert_eq!((&*listing, code), ("", Some(1)));
        assert!(error.starts_with("axle: cannot read \"/proc/self/mem\": "), "{error}");
    }
}

#[test]
fn the_protocol_is_found_out_and_the_tool_says_how_sure_it_is() {
    let captures = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures");
    let ucp = decode(&[], &format!("{captures}/ucp.bin"));
    let first = ucp.0.lines().next().unwrap();
    let says = "protocol ucp: 328 of the first 405 bytes are in its frames (ikeya 0, ikeya-3 0)";
    assert_eq!((first, ucp.1), (says, Some(0)));
    let ikeya = decode(&["--json"], &format!("{captures}/ikeya.bin"));
    let line: serde_json::Value = serde_json::from_str(ikeya.0.lines().next().unwrap()).unwrap();
    let expected = serde_json::json!({
        "event": "protocol", "protocol": "ikeya", "received": 90,
        "framed": {"ikeya": 68, "ikeya-3": 24, "ucp": 0},
    });
    assert_eq!(line, expected);
    // The rest is as with the protocol given.
    let given = decode(&["--protocol", "ucp"], &format!("{captures}/ucp.bin"));
    assert_eq!(ucp.0.split_once("\n\n").unwrap().1, given.0);
}

#[test]
fn the_protocol_of_a_stream_is_found_out_without_waiting_for_its_end() {
    use std::io::{BufRead, BufReader, Write};

    let ping = axlewire::ucp::Body::frame(axlewire::ucp::message::Ping {}, 0);
    let mut child = axle(&["decode"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&ping.as_bytes().repeat(3)).unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().starts_with("protocol ucp: 24 of the first 24"));
    // Standard input is still open.
    assert!(lines.by_ref().take(5).any(|line| line.unwrap().contains("ping")));
    drop(stdin);
    assert!(child.wait().unwrap().success());
}

#[test]
fn the_wrong_protocol_ends_with_a_hint() {
    let captures = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures");
    let (_, code, error) = decode(&["--protocol", "ikeya"], &format!("{captures}/ucp.bin"));
    let hint = "axle: no ikeya frame in 405 bytes, but 15 of ucp: use --protocol ucp\n";
    assert_eq!((&*error, code), (hint, Some(1)));
    let piped = std::fs::read(format!("{captures}/ucp.bin")).unwrap();
    let (_, code, error) = outcome(run(&["decode", "-P", "ikeya"], &piped));
    assert_eq!((&*error, code), (hint, Some(1)));
    let noise = file("noise.bin", &[0x11; 500]);
    for protocol in ["auto", "ucp"] {
        let (_, code, error) = decode(&["--protocol", protocol], noise.to_str().unwrap());
        assert!(code == Some(1) && error.starts_with("axle: no "), "{error}");
    }
    let empty = file("empty.bin", &[]);
    let (listing, code, _) = decode(&[], empty.to_str().unwrap());
    let expected = "The input is empty: 0 bytes received, 0 frames.\n";
    assert_eq!((&*listing, code), (expected, Some(0)));
}

#[test]
fn a_summary_alone_has_the_counts_of_the_listing() {
    let capture = Capture::noisy(100_000, 9).bytes;
    let listing = stdout(run(&["decode", "-P", "ucp"], &capture));
    let summary = stdout(run(&["decode", "-P", "ucp", "--summary"], &capture));
    assert_eq!(listing.split_once("\n\n").unwrap().1, summary);
    let mut buffer = [0; 8];
    let read = ReadRequest::new(NodeId::N1);
    let frame = read.encode(&mut buffer).unwrap();
    let json = stdout(run(&["decode", "-P", "ikeya", "-s", "-j"], frame));
    assert_eq!(json.lines().count(), 1);
    assert!(json.starts_with(r#"{"event":"summary","received":4,"framed":4,"#), "{json}");
}
