//! Captures that `axle replay` refuses before it opens a port.

mod support;

use axlewire::ikeya::{
    NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest,
};
use support::{
    file,
    pcapng::{PcapNg, outcome},
    run,
};

const IKEYA: u16 = 147;

/// The error line without the tool's name, and with CAPTURE for the path.
fn refusal(name: &str, capture: &[u8]) -> String {
    let path = file(name, capture);
    let path = path.to_str().unwrap();
    let args = ["replay", "--move", "-p", "/dev/no such port", "-P", "ikeya", path];
    let (listing, code, error) = outcome(run(&args, &[]));
    assert_eq!((&*listing, code), ("", Some(1)), "{error}");
    error.replace(&format!("{path:?}"), "CAPTURE").replace("axle: ", "").trim_end().to_owned()
}

fn answers() -> ([u8; 8], [u8; 8], [u8; 8]) {
    let node = NodeId::N1;
    let write = WriteRequest::velocity(node, Rps::new(1.0).unwrap());
    let speed = VelocityResponse::new(node, Rps::ZERO);
    let place = PositionResponse::new(node, Position::new(0, 0));
    (*write.as_bytes(), *speed.as_bytes(), *place.as_bytes())
}

#[test]
fn the_lines_of_a_capture_are_not_sent_to_one_port() {
    let (write, speed, place) = answers();
    let mut capture = PcapNg::new(IKEYA, &[(0, 0, &place), (1, 0, &write)]);
    capture.interface(IKEYA);
    capture.packet(1, (2, 0, &speed));
    assert_eq!(
        refusal("lines.pcapng", &capture.0),
        "CAPTURE has more than one line: choose one with --interface"
    );
}

#[test]
fn a_command_of_a_node_that_changes_its_mode_is_ambiguous() {
    let (write, speed, place) = answers();
    let capture = PcapNg::new(IKEYA, &[(0, 2, &write), (1, 1, &place), (2, 1, &speed)]).0;
    let says = "node 1 changes its mode in CAPTURE: its commands are ambiguous";
    assert_eq!(refusal("turned.pcapng", &capture), says);
    // A node that is not commanded may.
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    let capture = PcapNg::new(IKEYA, &[(0, 2, &read), (1, 1, &place), (2, 1, &speed)]).0;
    assert!(refusal("reads.pcapng", &capture).contains("no such port"));
}

#[test]
fn a_capture_without_packets_is_named() {
    let path = file("none.pcapng", &PcapNg::new(IKEYA, &[]).0);
    let path = path.to_str().unwrap();
    let (_, code, error) = outcome(run(&["replay", "-p", "x", path], &[]));
    assert_eq!((code, error), (Some(1), format!("axle: {path:?} has no bytes\n")));
}
