//! A capture summed up: `axle watch FILE`.

mod support;

use std::{io::Write, process::Stdio};

use axlewire::{
    ikeya::{NodeId, Position, PositionResponse, Rps, VelocityResponse, WriteRequest},
    ucp::{Body, message::Ping},
};
use serde_json::{Value, json};
use support::{
    axle,
    pcapng::{PcapNg, outcome},
    run, stdout,
};

const IKEYA: u16 = 147;
const UCP: u16 = 150;

/// A capture of rovers, one frame per second.
fn pings(count: u64) -> PcapNg {
    let mut capture = PcapNg::new(UCP, &[]);
    for at in 0..count {
        capture.packet(0, (at * 1_000_000, 1, Ping {}.frame(at as u8).as_bytes()));
    }
    capture
}

fn summary(args: &[&str], input: &[u8]) -> Value {
    let args = [&["watch", "--json", "-"], args].concat();
    serde_json::from_str(&stdout(run(&args, input))).unwrap()
}

#[test]
fn a_capture_on_standard_input_names_its_own_protocol() {
    let found = summary(&[], &pings(3).0);
    assert_eq!((&found["frames"], &found["t"]), (&json!(3), &json!(2.0)));
    assert_eq!(found["messages"][0]["message"], "ping");
}

#[test]
#[cfg(unix)]
fn a_capture_that_can_be_read_only_once_is_summed_up() {
    let file = support::file("once.pcapng", &pings(3).0);
    let shell = format!("cat {file:?} | {} watch --json /dev/stdin", env!("CARGO_BIN_EXE_axle"));
    let output = std::process::Command::new("sh").args(["-c", &shell]).output().unwrap();
    let found: Value = serde_json::from_str(&stdout(output)).unwrap();
    assert_eq!(found["frames"], 3);
}

#[test]
fn it_ends_with_the_frame_and_within_the_time_that_were_asked_for() {
    let capture = pings(9).0;
    let found = summary(&["--count", "5"], &capture);
    assert_eq!((&found["frames"], &found["t"]), (&json!(5), &json!(4.0)));
    assert_eq!(summary(&["--count", "20"], &capture)["frames"], 9);
    let found = summary(&["--for", "2.5"], &capture);
    assert_eq!((&found["frames"], &found["t"]), (&json!(3), &json!(2.0)));
    // Frames that come in one piece, and bytes of one more.
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let raw = [ping.repeat(1000), ping[..3].to_vec()].concat();
    for count in [5, 1000] {
        let found = summary(&["-P", "ucp", "--count", &count.to_string()], &raw);
        assert_eq!(
            (&found["frames"], &found["messages"][0]["count"]),
            (&json!(count), &json!(count))
        );
        assert_eq!(found["received"], 8 * count);
    }
}

#[test]
fn lines_of_several_protocols_are_told_apart() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let answer = *VelocityResponse::new(NodeId::N1, Rps::ZERO).as_bytes();
    let mut capture = PcapNg::new(UCP, &[(0, 0, &ping)]);
    capture.interface(IKEYA);
    capture.packet(1, (1, 0, &answer));
    let (table, code, error) = outcome(run(&["watch", "-"], &capture.0));
    assert_eq!(table, "");
    let says = "axle: the capture has more than one line: choose one with --interface\n";
    assert_eq!((code, &*error), (Some(1), says));
}

#[test]
fn the_nodes_of_each_line_have_modes_of_their_own() {
    let node = NodeId::N1;
    let write = *WriteRequest::velocity(node, Rps::new(1.0).unwrap()).as_bytes();
    let place = *PositionResponse::new(node, Position::new(0, 0)).as_bytes();
    let speed = *VelocityResponse::new(node, Rps::ZERO).as_bytes();
    let mut capture = PcapNg::new(IKEYA, &[(0, 0, &speed)]);
    capture.interface(IKEYA);
    capture.packet(1, (1, 0, &place));
    capture.packet(0, (2, 0, &write));
    let found = summary(&["--interface", "0"], &capture.0);
    let messages = found["messages"].as_array().unwrap();
    let write = messages.iter().find(|of| of["message"] == "write").unwrap();
    assert_eq!(write["last"], "1.0 rps");
}

#[test]
fn another_link_type_is_named_in_one_line() {
    let capture = PcapNg::new(1, &[(0, 0, &[1, 2, 3])]).0;
    let (table, code, error) = outcome(run(&["watch", "-"], &capture));
    assert_eq!((&*table, code), ("", Some(1)));
    assert!(error.contains("has link type 1") && error.lines().count() == 1, "{error}");
}

#[test]
#[ignore = "real time"]
fn many_sections_take_a_time_in_proportion() {
    // 40,000 recordings one behind the other: a minute, if each packet asked all lines.
    let one = pings(1).0;
    let begin = std::time::Instant::now();
    assert_eq!(summary(&[], &one.repeat(40_000))["frames"], 40_000);
    assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
}

#[test]
fn the_counts_add_up() {
    let ping = Ping {}.frame(0).as_bytes().to_vec();
    let raw = [&[1, 2][..], &ping, &ping[..5]].concat();
    let found = summary(&["-P", "ucp"], &raw);
    let count = |field: &str| found[field].as_u64().unwrap();
    assert_eq!(count("received"), 15);
    assert_eq!(count("received"), count("framed") + count("skipped") + count("pending"));
}

#[test]
fn on_a_pipe_the_last_frame_that_is_wanted_is_the_end() {
    let mut child = axle(&["watch", "--json", "--count", "3", "-P", "ucp", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&Ping {}.frame(0).as_bytes().repeat(3)).unwrap();
    // More may come: the pipe stays open.
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["frames"], 3);
}
