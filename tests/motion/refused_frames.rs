//! Frames that must not be sent are refused, however their bytes were created.

use axlewire::{
    encode::Encode,
    error::EncodeError,
    ucp::{
        Body, Frame, FrameOf, Message, MotorControl,
        message::{Ping, RawMotorControl},
    },
};
use zerocopy::TryFromBytes;

#[test]
fn a_frame_cast_from_bytes_is_not_sent_under_an_id_that_is_not_its_bodys() {
    let mut bytes = *Ping {}.frame(0).as_bytes().first_chunk::<8>().unwrap();
    bytes[4] = 5;
    let crc = axlewire::crc16::compute(&bytes[..6]).to_le_bytes();
    bytes[6..].copy_from_slice(&crc);
    // A cast that refuses the id is also correct.
    let cast = FrameOf::<Ping>::try_read_from_bytes(&bytes).ok();
    let mut buffer = [0; 64];
    let sent = cast.and_then(|frame| frame.encode(&mut buffer).ok());
    assert_eq!(sent, None, "a ping with the id of a report is sent");
}

/// A motor command from a careless sender: 130 %, version 99.
fn careless() -> [u8; 16] {
    let mut body = [0; 16];
    (body[0], body[8]) = (130, 99);
    body
}

#[test]
fn a_motor_command_cast_from_bytes_neither_starts_an_update_nor_is_out_of_range() {
    // Bytes can only be cast to a received command, never to one that can be framed.
    let received: RawMotorControl = zerocopy::transmute!(careless());
    assert!(received.starts_update());
    let refused = EncodeError::StartsUpdate { version: 99 };
    assert_eq!(MotorControl::try_from(received), Err(refused));
    let mut body = careless();
    body[8] = 38;
    let received: RawMotorControl = zerocopy::transmute!(body);
    let refused = EncodeError::Percent { value: 130, min: -100, max: 100 };
    assert_eq!(MotorControl::try_from(received), Err(refused));
}

#[test]
fn a_motor_command_copied_from_a_received_frame_is_not_sent_as_it_is() {
    let mut received = vec![0xFD, 0xFF, 20, 0, 2, 0];
    received.extend(careless());
    let crc = axlewire::crc16::compute(&received).to_le_bytes();
    received.extend(crc);
    let Message::MotorControl(command) = Frame::parse(&received).unwrap().message() else {
        panic!("it is a motor command");
    };
    assert!(MotorControl::try_from(*command).is_err());
    // In range and without an update, only speed, turn and lamp are copied.
    let mut body = [0xFF_u8; 16];
    body[..6].copy_from_slice(&[50, 0, 0xF6, 0xFF, 1, 0]);
    let received: RawMotorControl = zerocopy::transmute!(body);
    let command = MotorControl::try_from(received).unwrap();
    let harmless = MotorControl::new(50, -10).unwrap().with_front_led(true);
    assert_eq!(command.frame(7).as_bytes(), harmless.frame(7).as_bytes());
}
