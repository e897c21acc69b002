//! A message of one's own is one entry of the table: in unit tests the tables have one more.

extern crate alloc;

use alloc::{format, string::ToString, vec, vec::Vec};

use serde_json::{json, to_value};

use super::{
    Body, Frame, Host, Message, MessageId, RawFrame, Robot, Ucp,
    host::{HostConfig, HostEvent},
    message::{ErrorCode, LampColour, LampState, SetLamp},
    robot::RobotConfig,
};
use crate::{
    encode::Encode, endpoint::Endpoint, error::EncodeError, fields::FIELDS, stream::Frames,
    time::Instant,
};

/// Hands a table to the macro that expands it, with one more entry.
macro_rules! expand_table {
    (codes $($table:tt)+) => {
        codes! {
            $($table)+

            /// Colour of a lamp.
            LampColour: u8 = "u8", "colour" {
                /// White.
                White = 0, "white";
                /// Red.
                Red = 1, "red";
            }
        }
    };
    ($expand:ident $($table:tt)+) => {
        $expand! {
            $($table)+

            /// Lamp command to the robot, temperatures of the lamps to the host.
            Lamp = 0x42 {
                /// Host to robot: `brightness | colour | time: u16`, 4 bytes.
                to_robot "set_lamp" SetLamp(&'a SetLamp) {
                    /// Brightness, percent.
                    brightness: u8 as u8 = "brightness_pct" in "%",
                    /// Colour.
                    colour: u8 as LampColour = "colour",
                    /// For how long, milliseconds.
                    time: [u8; 2] as u16 = "time_ms" in "ms",
                }

                /// Robot to host, answers a [`SetLamp`]: `temperature: 2 × i16 | err`, 5 bytes.
                to_host "lamp_state" LampState(&'a LampState) {
                    /// Temperatures, left and right, degrees Celsius.
                    temperature: [[u8; 2]; 2] as [i16; 2] = "temperature_c" in "C",
                    /// Whether the command arrived undamaged.
                    err: u8 as ErrorCode = "err",
                }
            }
        }
    };
}
pub(super) use expand_table;

/// `brightness 80 | colour 1 | time 1500`, then `temperature 25, -3 | err 0`, each in its frame.
fn frames() -> [Vec<u8>; 2] {
    let frames: [&[u8]; 2] = [
        &[0xFD, 0xFF, 8, 0, 0x42, 7, 80, 1, 0xDC, 5],
        &[0xFD, 0xFF, 9, 0, 0x42, 2, 25, 0, 0xFD, 0xFF, 0],
    ];
    frames.map(|frame| [frame, &crate::crc16::compute(frame).to_le_bytes()].concat())
}

#[test]
fn a_new_message_is_encoded_found_and_read() {
    let [command, state] = frames();
    assert_eq!(SetLamp::new(80, LampColour::Red, 1500).frame(7).as_bytes(), command);
    assert_eq!(LampState::new([25, -3], ErrorCode::Fine).frame(2).as_bytes(), state);
    let stream = [&[0x00, 0xFD][..], &command, &state].concat();
    let mut found = Frames::<Ucp>::new(&stream);
    let messages: Vec<_> = found.by_ref().map(Frame::message).collect();
    let [Message::SetLamp(command), Message::LampState(state)] = messages[..] else {
        panic!("{messages:?}");
    };
    let values = (command.brightness(), command.colour(), command.time());
    assert_eq!(values, (80, LampColour::Red, 1500));
    assert_eq!((state.temperature(), state.err()), ([25, -3], ErrorCode::Fine));
    assert_eq!((found.counters().framed, found.counters().skipped()), (25, 2));
    for (message, name, from_host) in [(0, "set_lamp", true), (1, "lamp_state", false)] {
        let message = &messages[message];
        assert_eq!((message.id(), message.name()), (MessageId::Lamp as u8, name));
        assert_eq!(message.is_from_host(), Some(from_host));
    }
}

#[test]
fn a_new_message_prints_its_values_with_their_units_and_is_data_with_its_keys() {
    let [command, state] = frames();
    let [command, state] = [&command, &state].map(|frame| Frame::parse(frame).unwrap());
    assert_eq!(command.to_string(), "set_lamp, index 7: brightness 80 %, red, time 1500 ms");
    assert_eq!(state.message().to_string(), "lamp_state: temperature 25 -3 C, fine");
    let text = "SetLamp { brightness: 0, colour: Other(9), time: 0 }";
    assert_eq!(format!("{:?}", SetLamp::new(0, LampColour::Other(9), 0)), text);
    let data = json!({
        "length": 12, "protocol": "ucp", "message": "set_lamp", "id": 66, "index": 7,
        "brightness_pct": 80, "colour": 1, "time_ms": 1500, "bytes": "fdff080042075001dc05c28d",
    });
    assert_eq!(to_value(command).unwrap(), data);
    let data = json!({"message": "lamp_state", "id": 66, "temperature_c": [25, -3], "err": 0});
    assert_eq!(to_value(state.message()).unwrap(), data);
}

#[test]
fn a_new_message_is_in_the_table_of_fields() {
    let told = |message: &str| -> Vec<_> {
        let record = FIELDS.iter().find(|record| record.message == message).unwrap();
        assert_eq!(
            (record.id, record.length.map(|it| it.0)),
            (Some(0x42), record.length.map(|it| it.1))
        );
        let own = record.fields().filter(|field| !field.is_of_tool).skip(5);
        own.map(|field| (field.name, field.kind.name(), field.unit, field.meaning)).collect()
    };
    let fields = [
        ("brightness_pct", "u8", "%", "Brightness, percent"),
        ("colour", "u8", "none", "Colour"),
        ("time_ms", "u16", "ms", "For how long, milliseconds"),
        ("bytes", "bytes", "none", "The whole frame as on the wire"),
    ];
    assert_eq!(told("set_lamp"), fields);
    let temperature = "Temperatures, left and right, degrees Celsius";
    assert_eq!(told("lamp_state")[0], ("temperature_c", "i16", "C", temperature));
}

#[test]
fn a_new_message_with_another_length_is_unknown_and_its_id_cannot_be_sent_raw() {
    for length in (0..=56).filter(|length| ![4, 5].contains(length)) {
        let header = [0xFD, 0xFF, length as u8 + 4, 0, 0x42, 0];
        let bytes = [&header[..], &vec![1; length]].concat();
        let bytes = [&bytes[..], &crate::crc16::compute(&bytes).to_le_bytes()].concat();
        assert!(matches!(Frame::parse(&bytes).unwrap().message(), Message::Unknown(_)), "{length}");
    }
    let raw = RawFrame { id: 0x42, index: 0, body: &[] };
    assert_eq!(raw.encode(&mut [0; 64]), Err(EncodeError::KnownId { id: 0x42 }));
}

#[test]
fn a_role_counts_a_new_message_and_the_application_of_a_host_gets_it() {
    let (now, [command, state]) = (Instant::from_micros(0), frames());
    let mut robot = Robot::new(RobotConfig::default(), now);
    let mut host = Host::new(HostConfig::default(), now);
    for frame in [command, state] {
        robot.handle_input(&frame, now);
        host.handle_input(&frame, now);
    }
    assert_eq!((robot.statistics().unknown, robot.statistics().misdirected), (1, 1));
    assert_eq!((host.statistics().unknown, host.statistics().misdirected), (1, 1));
    let mut events = core::iter::from_fn(|| host.poll_event());
    let Some(HostEvent::Unknown(frame)) = events.find(|it| matches!(it, HostEvent::Unknown(_)))
    else {
        panic!("the application gets nothing");
    };
    assert_eq!(frame.as_raw().body, [25, 0, 0xFD, 0xFF, 0]);
}
