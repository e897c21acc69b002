//! Messages and the frames that they become.

use axlewire::{
    crc16,
    ikeya::{NodeId, ReadRequest, Rps, WriteRequest, three},
};
use clap::Parser;

use super::*;
use crate::args::Protocol;

#[derive(Debug, Parser)]
struct Only {
    #[command(flatten)]
    args: Args,
}

fn parsed(words: &str) -> Args {
    let words = ["send", "-p", "x"].into_iter().chain(words.split(' '));
    Only::try_parse_from(words).unwrap().args
}

/// The bytes of the first frame.
fn bytes(words: &str) -> Vec<u8> {
    plan(&parsed(words)).unwrap().frames[0].bytes.to_vec()
}

fn frame(id: u8, index: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, body.len() as u8 + 4, 0, id, index];
    frame.extend(body);
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}

fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

#[test]
fn each_message_to_a_robot_has_its_id_and_its_fields_in_their_order() {
    let motor = |speed: i16, turn: i16, lamp: i16| {
        let fields = [speed, turn, lamp, 0, 0, 0, 0, 0];
        frame(2, 0, &fields.map(i16::to_le_bytes).concat())
    };
    assert_eq!(bytes("ucp ping"), frame(1, 0, &[]));
    assert_eq!(bytes("ucp motor 40 -10"), motor(40, -10, 0));
    assert_eq!(bytes("ucp motor -40 10 --lamp"), motor(-40, 10, 100));
    for (words, id) in [("calibration-start", 3), ("calibration-end", 4)] {
        assert_eq!(bytes(&format!("ucp {words} magnetometer")), frame(id, 0, &[1]));
        assert_eq!(bytes(&format!("ucp {words} imu")), frame(id, 0, &[2]));
    }
    assert_eq!(bytes("ucp imu-bias-ack"), frame(6, 0, &[0]));
    assert_eq!(bytes("ucp mag-bias-ack"), frame(7, 0, &[0]));
    let biases = bytes("ucp biases 1 -2 3 4 5 6 7 8 9");
    let values: Vec<i16> =
        biases[7..25].chunks(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect();
    assert_eq!((biases[4], values), (8, vec![1, -2, 3, 4, 5, 6, 7, 8, 9]));
    let states = ["unknown", "sim-absent", "disconnected", "connected", "ota"];
    let sent = states.map(|state| bytes(&format!("ucp network-state {state}"))[6]);
    assert!(sent.iter().enumerate().all(|(at, it)| !sent[..at].contains(it)), "{sent:?}");
}

#[test]
fn each_packet_to_a_node_has_its_values_in_their_order() {
    let (a, b, c) = (rps(1.0), rps(-2.0), rps(0.5));
    assert_eq!(bytes("ikeya read 3"), ReadRequest::new(NodeId::N3).as_bytes());
    assert_eq!(bytes("ikeya velocity 2 1"), WriteRequest::velocity(NodeId::N2, a).as_bytes());
    let three = three::WriteRequest::velocity(NodeId::N2, [a, b, c]);
    assert_eq!(bytes("ikeya-3 velocity 2 1 -2 0.5"), three.as_bytes());
    let places = ["1", "-2", "0.5"].map(|text| args::revolutions(text).unwrap());
    let one = WriteRequest::position(NodeId::N2, places[1]);
    assert_eq!(bytes("ikeya position 2 -2"), one.as_bytes());
    let three = three::WriteRequest::position(NodeId::N2, places);
    assert_eq!(bytes("ikeya-3 position 2 1 -2 0.5"), three.as_bytes());
    for words in ["ikeya velocity 1 1 2 3", "ikeya-3 position 1 1"] {
        assert!(matches!(plan(&parsed(words)), Err(Failure::Usage(_))), "{words}");
    }
}

#[test]
fn a_command_says_which_mode_it_is_meant_for_unless_it_is_hex_digits() {
    use axlewire::ikeya::Mode::{Position, Velocity};
    for (words, protocol, meant) in [
        ("ikeya velocity 1 1", Protocol::Ikeya, Some(Velocity)),
        ("ikeya position 1 1", Protocol::Ikeya, Some(Position)),
        ("ikeya-3 velocity 1 1 2 3", Protocol::Ikeya3, Some(Velocity)),
        ("ikeya-3 position 1 1 2 3", Protocol::Ikeya3, Some(Position)),
        ("ikeya hex BB010000803F0740", Protocol::Ikeya, None),
        ("ucp motor 1 1", Protocol::Ucp, None),
    ] {
        let args = parsed(words);
        let plan = plan(&args).unwrap();
        assert_eq!((plan.protocol, plan.frames[0].meant), (protocol, meant), "{words}");
    }
}

#[test]
fn a_message_is_sent_as_often_and_at_the_intervals_that_were_asked_for() {
    let args = parsed("-c 3 --every 0.25 -f 0.75 --max-rps 5 --max-turns 7 -j ucp ping");
    let plan = plan(&args).unwrap();
    let at: Vec<_> = plan.frames.iter().map(|due| due.after_us).collect();
    assert_eq!((at, plan.linger_us), (vec![0, 250_000, 500_000], 750_000));
    assert_eq!((plan.limits.max_rps.get(), plan.limits.max_turns), (5.0, 7.0));
    assert!(plan.is_json && plan.side == Side::Commander);
    // The index counts the frames of a host.
    for (index, due) in plan.frames.iter().enumerate() {
        assert_eq!(*due.bytes, *frame(1, index as u8, &[]));
    }
}

#[test]
fn a_frame_of_the_other_side_is_refused() {
    let device = frame(5, 0, &[0; 36]).iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    let refused = |words: &str| plan(&parsed(words)).err().map(|it| it.to_string());
    let says = refused(&format!("ucp hex {device}")).unwrap();
    assert_eq!(says, "nothing is sent: the frame is one of a device, see --as");
    assert_eq!(refused(&format!("--as device ucp hex {device}")), None);
    let says = refused("--as device ucp ping").unwrap();
    assert_eq!(says, "nothing is sent: the frame is one of a commander, see --as");
}
