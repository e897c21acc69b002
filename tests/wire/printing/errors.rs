//! Errors in words: the text of each, on one line, and the error behind it.

use std::error::Error;

use axlewire::{ikeya, ucp};

use crate::rig::*;

/// Each error has its text, and no error behind it.
fn assert_texts(table: &[(&dyn Error, &str)]) {
    for (error, text) in table {
        assert_eq!(error.to_string(), *text);
        assert!(error.source().is_none(), "{text}");
    }
}

#[test]
fn an_error_of_a_packet_says_what_was_expected_and_what_was_found() {
    assert_texts(&[
        (&ParseError::Length { expected: 8, found: 7 }, "packet has 8 bytes, but slice has 7"),
        (&ParseError::Field, "header or node id does not belong to this packet"),
        (
            &ParseError::Crc { expected: 0x00AB, found: 0xF00D },
            "CRC is 0x00ab, but packet has 0xf00d",
        ),
    ]);
}

#[test]
fn an_error_of_a_value_names_the_value_and_its_limits() {
    let position = EncodeError::Position { counts: 9, min: -5, max: 7 };
    let percent = EncodeError::Percent { value: 101, min: -100, max: 99 };
    let small = EncodeError::BufferTooSmall { needed: 8, available: 7 };
    let long = EncodeError::BodyTooLong { length: 57, limit: 56 };
    assert_texts(&[
        (&EncodeError::NodeId { value: 9 }, "node id 9 is outside 1..=8"),
        (&EncodeError::DipSwitch { bits: 0b0001 }, "DIP switches 0b0001 select no node"),
        (&EncodeError::DipSwitch { bits: 0b1_0000 }, "DIP switches 0b10000 select no node"),
        (&EncodeError::NotFinite { value: f64::INFINITY }, "inf is not a finite number"),
        (&position, "position of 9 counts is outside -5..=7"),
        (&percent, "101 is outside -100..=99"),
        (&EncodeError::NetworkState { value: 256 }, "network state 256 does not fit into one byte"),
        (&small, "frame needs 8 bytes, buffer has 7"),
        (&long, "body of 57 bytes is longer than 56"),
        (
            &EncodeError::NestedHeader { at: 9 },
            "FD FF at byte 9: shipped robots would take it for another frame",
        ),
        (
            &EncodeError::KnownId { id: 5 },
            "id 0x05 has its own message type and cannot be sent raw",
        ),
        (
            &EncodeError::StartsUpdate { version: 39 },
            "motor command with version 39 would start a firmware update",
        ),
        (
            &EncodeError::Header { id: 5, len: 40 },
            "header (id 0x05, length 40) does not match its body",
        ),
    ]);
}

#[test]
fn a_refused_command_says_why() {
    use ikeya::master::CommandError as Bus;
    use ucp::host::CommandError as Rover;
    let node = NodeId::N4;
    assert_texts(&[
        (&Bus::NotOnline { node }, "node 4 is not online"),
        (&Bus::WrongMode { node, mode: Mode::Velocity }, "node 4 is in velocity mode"),
        (&Bus::WrongMode { node, mode: Mode::Position }, "node 4 is in position mode"),
        (&Bus::ModeInDoubt { node }, "the mode of node 4 is in doubt"),
        (&Bus::StopOwed { node }, "node 4 has not confirmed its stop yet"),
        (&Bus::NoSetPoint { node }, "node 4 has no set-point"),
        (&Rover::CalibrationKind { kind: 7 }, "no robot can calibrate 7"),
        (&Rover::Calibrating, "a calibration request is still unanswered"),
        (
            &Rover::LowIdsOnly { id: 10 },
            "frames with id 0x0a are disabled: this robot may hang on them",
        ),
        (&Rover::Moving, "a firmware update needs a robot that is seen to stand still"),
        (&Rover::Updating, "a firmware update is in progress"),
        (&ucp::host::NotStored, "the calibration result was not stored"),
    ]);
    let value = EncodeError::NetworkState { value: 256 };
    let refused = Rover::Value(value);
    assert_eq!((refused.to_string(), refused.source().is_none()), (value.to_string(), true));
}
