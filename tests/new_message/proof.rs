//! The message of `added.patch` behaves as the others. Run by `tests/new_message.py` in a copy of
//! the tree to which the patch has been applied.

use axlewire::{
    encode::Encode,
    endpoint::Endpoint,
    error::EncodeError,
    stream::Frames,
    time::Instant,
    ucp::{
        Body, Frame, FrameOf, Host, Message, MessageId, RawFrame, Robot, Ucp,
        host::{HostConfig, HostEvent},
        message::{ErrorCode, LampColour, LampState, SetLamp},
        robot::RobotConfig,
    },
};
use serde_json::{json, to_value};

/// `brightness 80 | colour 1 | time 1500`, in a frame made by hand but for its CRC.
fn set_lamp() -> Vec<u8> {
    sealed(&[0xFD, 0xFF, 0x08, 0x00, 0x42, 0x07, 80, 1, 0xDC, 0x05])
}

/// `temperature 25, -3 | err 0`
fn lamp_state() -> Vec<u8> {
    sealed(&[0xFD, 0xFF, 0x09, 0x00, 0x42, 0x02, 25, 0, 0xFD, 0xFF, 0])
}

fn sealed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &axlewire::crc16::compute(bytes).to_le_bytes()].concat()
}

#[test]
fn it_is_encoded_into_the_bytes_of_its_fields() {
    let command = SetLamp::new(80, LampColour::Red, 1500).frame(7);
    assert_eq!(command.as_bytes(), set_lamp());
    assert_eq!(command.encode(&mut [0; 64]), Ok(&*set_lamp()));
    let answer = LampState::new([25, -3], ErrorCode::Fine).frame(2);
    assert_eq!(answer.as_bytes(), lamp_state());
    assert_eq!((FrameOf::<SetLamp>::LEN, FrameOf::<LampState>::LEN), (12, 13));
}

#[test]
fn it_is_found_in_a_stream_and_has_its_values() {
    let stream = [&[0x00, 0xFD][..], &set_lamp(), &lamp_state()].concat();
    let mut frames = Frames::<Ucp>::new(&stream);
    let Some(Message::SetLamp(command)) = frames.next().map(Frame::message) else { panic!() };
    assert_eq!(
        (command.brightness(), command.colour(), command.time()),
        (80, LampColour::Red, 1500)
    );
    let Some(Message::LampState(state)) = frames.next().map(Frame::message) else { panic!() };
    assert_eq!((state.temperature(), state.err()), ([25, -3], ErrorCode::Fine));
    assert!(frames.next().is_none());
    assert_eq!((frames.counters().framed, frames.counters().skipped()), (25, 2));
}

#[test]
fn it_has_its_id_its_name_and_its_direction() {
    let (command, answer) = (set_lamp(), lamp_state());
    for (bytes, name, from_host) in [(command, "set_lamp", true), (answer, "lamp_state", false)] {
        let message = Frame::parse(&bytes).unwrap().message();
        assert_eq!((message.id(), message.name()), (0x42, name));
        assert_eq!(message.is_from_host(), Some(from_host));
    }
    assert_eq!(MessageId::from_u8(0x42), Some(MessageId::Lamp));
    assert_eq!((SetLamp::ID as u8, LampState::ID as u8), (0x42, 0x42));
}

#[test]
fn it_prints_its_values_with_their_units() {
    let (command, answer) = (set_lamp(), lamp_state());
    let frame = Frame::parse(&command).unwrap();
    assert_eq!(frame.to_string(), "set_lamp, index 7: brightness 80 %, red, time 1500 ms");
    let message = Frame::parse(&answer).unwrap().message();
    assert_eq!(message.to_string(), "lamp_state: temperature 25 -3 C, fine");
    assert_eq!(message.contents().to_string(), "temperature 25 -3 C, fine");
    let body = SetLamp::new(0, LampColour::Other(9), 0);
    let text = "SetLamp { brightness: 0, colour: Other(9), time: 0 }";
    assert_eq!(format!("{body:?}"), text);
    assert_eq!(
        Message::SetLamp(&body).to_string(),
        "set_lamp: brightness 0 %, colour 9, time 0 ms"
    );
}

#[test]
fn it_is_data_with_the_keys_of_its_fields() {
    let (command, answer) = (set_lamp(), lamp_state());
    assert_eq!(
        to_value(Frame::parse(&command).unwrap()).unwrap(),
        json!({
            "length": 12, "protocol": "ucp", "message": "set_lamp", "id": 66, "index": 7,
            "brightness_pct": 80, "colour": 1, "time_ms": 1500, "bytes": hex(&command),
        })
    );
    assert_eq!(
        to_value(Frame::parse(&answer).unwrap().message()).unwrap(),
        json!({"message": "lamp_state", "id": 66, "temperature_c": [25, -3], "err": 0})
    );
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_body_of_another_length_is_unknown_and_cannot_be_sent_as_a_raw_frame() {
    for length in (0..=56).filter(|length| ![4, 5].contains(length)) {
        let header = [0xFD, 0xFF, length as u8 + 4, 0, 0x42, 0];
        let bytes = sealed(&[&header[..], &vec![1; length]].concat());
        assert!(matches!(Frame::parse(&bytes).unwrap().message(), Message::Unknown(_)), "{length}");
    }
    let raw = RawFrame { id: 0x42, index: 0, body: &[] };
    assert_eq!(raw.encode(&mut [0; 64]), Err(EncodeError::KnownId { id: 0x42 }));
}

#[test]
fn a_role_that_has_no_use_for_it_counts_it_and_the_application_of_a_host_gets_it() {
    let now = Instant::from_micros(0);
    let mut robot = Robot::new(RobotConfig::default(), now);
    robot.handle_input(&set_lamp(), now);
    assert_eq!((robot.statistics().unknown, robot.statistics().misdirected), (1, 0));
    robot.handle_input(&lamp_state(), now);
    assert_eq!((robot.statistics().unknown, robot.statistics().misdirected), (1, 1));

    let mut host = Host::new(HostConfig::default(), now);
    host.handle_input(&set_lamp(), now);
    assert_eq!((host.statistics().unknown, host.statistics().misdirected), (0, 1));
    host.handle_input(&lamp_state(), now);
    assert_eq!((host.statistics().unknown, host.statistics().misdirected), (1, 1));
    let events = std::iter::from_fn(|| host.poll_event());
    let got: Vec<_> = events.filter(|event| matches!(event, HostEvent::Unknown(_))).collect();
    let [HostEvent::Unknown(frame)] = &got[..] else { panic!("{got:?}") };
    let raw = RawFrame { id: 0x42, index: 2, body: &[25, 0, 0xFD, 0xFF, 0] };
    assert_eq!(frame.as_raw(), raw);
}
