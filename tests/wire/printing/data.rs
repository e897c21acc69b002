//! Packets and messages as data: the fields of `axle decode --json`, and the bytes.
#![cfg(feature = "serde")]

use axlewire::ikeya::{Status, board::ThreeMotors};
use serde_json::{Value, json, to_string, to_value};

use super::ucp::each_kind;
use crate::rig::*;

#[test]
fn a_frame_has_its_fields_in_order_and_its_bytes() {
    let telemetry = Telemetry {
        battery_pct: 87,
        rpm: [1, -2, 3, -4],
        acc: [5, 6, 7],
        gyro: [8, 9, 10],
        mag: [11, 12, 13],
        heading_deg: 180,
        power_w: 6,
        voltage_dv: 119,
        current_ca: 55,
    };
    let sent = FirmwareReport::new(&telemetry, 38).frame(3);
    let expected = r#"{"length":44,"protocol":"ucp","message":"report","id":5,"index":3,"layout":"firmware","battery_pct":87,"rpm":[1,-2,3,-4],"acc":[5,6,7],"gyro":[8,9,10],"mag":[11,12,13],"heading":180,"power_w":6,"voltage_dv":119,"current_ca":55,"version":38,"bytes":"HEX"}"#;
    assert_eq!(
        to_string(Frame::parse(sent.as_bytes()).unwrap()).unwrap(),
        expected.replace("HEX", &hex(sent.as_bytes()))
    );
}

#[test]
fn a_message_alone_has_its_name_its_id_and_its_fields() {
    each_kind(|message, id, name, _| {
        let data = to_value(message).unwrap();
        assert_eq!((&data["message"], &data["id"]), (&json!(name), &json!(id)));
        assert!(data.get("bytes").is_none() && data.get("index").is_none());
    });
    let command = MotorControl::new(-60, 20).unwrap().into();
    assert_eq!(
        to_value(Message::MotorControl(&command)).unwrap(),
        json!({
            "message": "motor_control", "id": 2, "speed": -60, "angular": 20, "front_led": 0,
            "back_led": 0, "version": 0, "reserve1": 0, "reserve2": 0,
        })
    );
}

#[test]
fn each_message_has_its_own_fields_with_the_values_of_its_body() {
    const IMU: [&str; 2] = ["acc_bias", "gyro_bias"];
    let ack = &["err"][..];
    let rows: [(u8, usize, &str, &[&str]); 18] = [
        (1, 0, "ping", &[]),
        (1, 1, "pong", ack),
        (
            2,
            16,
            "motor_control",
            &["speed", "angular", "front_led", "back_led", "version", "reserve1", "reserve2"],
        ),
        (3, 1, "calibration_start", &["type"]),
        (3, 2, "calibration_start_ack", &["type", "err"]),
        (4, 1, "calibration_end", &["type"]),
        (4, 2, "calibration_end_ack", &["type", "err"]),
        (6, 12, "imu_bias", &IMU),
        (6, 1, "imu_bias_ack", ack),
        (7, 6, "mag_bias", &["mag_bias"]),
        (7, 1, "mag_bias_ack", ack),
        (8, 0, "bias_request", &[]),
        (8, 19, "biases", &["err", "acc_bias", "gyro_bias", "mag_bias"]),
        (9, 2, "ota_request", &["version"]),
        (9, 1, "ota_ack", ack),
        (10, 1, "network_state", &["state", "state_width"]),
        (10, 4, "network_state", &["state", "state_width"]),
        (10, 5, "unknown", &["body"]),
    ];
    // Sizes of the values, to cut the body of ascending bytes into them.
    let width = |name: &str, field: &str, len: usize| match field {
        "err" | "type" => 1,
        "reserve2" => 4,
        "acc_bias" | "gyro_bias" | "mag_bias" => 6,
        "state" => len,
        _ if name == "unknown" => len,
        _ => 2,
    };
    for (id, len, name, fields) in rows {
        let body: Vec<u8> = (1..=len as u8).collect();
        let bytes = frame(id, 9, &body);
        let received = Frame::parse(&bytes).unwrap();
        let mut expected = json!({
            "length": len + 8, "protocol": "ucp", "message": name, "id": id, "index": 9,
            "bytes": hex(&bytes),
        });
        let mut rest = &body[..];
        for field in fields {
            if *field == "state_width" {
                expected[field] = len.into();
                continue;
            }
            let (value, behind) = rest.split_at(width(name, field, len));
            rest = behind;
            let number = |bytes: &[u8]| -> u64 {
                bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
            };
            expected[field] = match value.len() {
                _ if name == "unknown" => "0102030405".into(),
                6 => value.chunks(2).map(number).collect(),
                _ => number(value).into(),
            };
        }
        assert!(rest.is_empty(), "{name}");
        assert_eq!(to_value(received).unwrap(), expected);

        for field in ["length", "protocol", "index", "bytes"] {
            expected.as_object_mut().unwrap().remove(field);
        }
        assert_eq!(to_value(received.message()).unwrap(), expected);
    }
}

#[test]
fn the_longest_frame_has_all_its_bytes() {
    let body: Vec<u8> = (0..248).collect();
    let bytes = frame(0x20, 1, &body);
    let data = to_value(Frame::parse(&bytes).unwrap()).unwrap();
    assert_eq!((&data["body"], &data["bytes"]), (&json!(hex(&body)), &json!(hex(&bytes))));
    assert_eq!(data["length"], 256);
}

#[test]
fn packets_have_their_node_their_values_and_their_bytes() {
    let (rps, position) = (Rps::new(-0.5).unwrap(), Position::new(4096, 1));
    let read = ReadRequest::new(NodeId::N1);
    assert_eq!(
        to_string(&Request::Read(&read)).unwrap(),
        r#"{"length":4,"protocol":"ikeya","message":"read_request","node":1,"bytes":"aa01bed0"}"#
    );
    let write = WriteRequest::velocity(NodeId::N1, rps);
    let text = r#"{"length":8,"protocol":"ikeya","message":"write","node":1,"rps":-0.5,"count":0,"rotation":-16640,"payload":"000000bf","bytes":"bb01000000bf6720"}"#;
    assert_eq!(to_string(&Request::Write(&write)).unwrap(), text);
    assert_eq!(to_string(&Packet::Request(Request::Write(&write))).unwrap(), text);
    let at = PositionResponse::new(NodeId::N3, position);
    assert_eq!(
        to_string(&Response::Position(&at)).unwrap(),
        r#"{"length":8,"protocol":"ikeya","message":"position_response","node":3,"count":4096,"rotation":1,"bytes":"5603001001004878"}"#
    );
}

#[test]
fn three_motors_have_three_values() {
    let (rps, position) = (Rps::new(1.5).unwrap(), Position::new(4096, 1));
    let write = three::WriteRequest::position(NodeId::N5, [position; 3]);
    let data = to_value(three::Request::Write(&write)).unwrap();
    assert_eq!(data["protocol"], "ikeya-3");
    assert_eq!(
        (&data["count"], &data["rotation"]),
        (&json!([4096, 4096, 4096]), &json!([1, 1, 1]))
    );
    assert_eq!(data["payload"], "001000100010010001000100");
    assert_eq!(write.payload(), [[0, 16, 0, 16], [0, 16, 1, 0], [1, 0, 1, 0]]);
    assert_eq!(data["rps"].as_array().map(Vec::len), Some(3));
    let velocity = three::VelocityResponse::new(NodeId::N5, [rps; 3]);
    let data = to_value(three::Packet::Response(three::Response::Velocity(&velocity))).unwrap();
    assert_eq!(data["rps"], json!([1.5, 1.5, 1.5]));
    let read = ReadRequest::new(NodeId::N1);
    assert_eq!(to_value(three::Request::Read(&read)).unwrap()["protocol"], "ikeya-3");
}

#[test]
fn a_speed_that_is_no_number_is_a_string() {
    let speed = |bits: [u8; 4]| -> Value {
        let packet = sealed(&[&[0x55, 1][..], &bits].concat());
        let response = VelocityResponse::parse(packet[..].try_into().unwrap()).unwrap();
        to_value(Response::Velocity(response)).unwrap()["rps"].clone()
    };
    assert_eq!(speed(f32::NAN.to_le_bytes()), "nan");
    assert_eq!(speed(f32::INFINITY.to_le_bytes()), "inf");
    assert_eq!(speed(f32::NEG_INFINITY.to_le_bytes()), "-inf");
    assert_eq!(speed((-0.0f32).to_le_bytes()), -0.0);
}

#[test]
fn a_status_has_the_values_of_its_response() {
    let status: Status = Status::Velocity(1.5);
    assert_eq!(to_value(status).unwrap(), json!({"rps": 1.5}));
    let status: Status = Status::Position(Position::new(1, 2));
    assert_eq!(to_value(status).unwrap(), json!({"count": 1, "rotation": 2}));
    let status: Status<ThreeMotors> = Status::Velocity([1.5, 2.5, -3.5]);
    assert_eq!(to_value(status).unwrap(), json!({"rps": [1.5, 2.5, -3.5]}));
    let status: Status<ThreeMotors> = Status::Position([Position::new(1, 2); 3]);
    assert_eq!(to_value(status).unwrap(), json!({"count": [1, 1, 1], "rotation": [2, 2, 2]}));
}

#[test]
fn a_gap_has_its_length_and_its_reason() {
    let gap = Gap { len: 3, reason: Reason::Crc };
    let text = r#"{"length":3,"reason":"crc"}"#;
    assert_eq!(to_string(&gap).unwrap(), text);
    assert_eq!(serde_json::from_str::<Gap>(text).unwrap(), gap);
    assert!(to_value(Frame::parse(Ping {}.frame(0).as_bytes()).unwrap()).is_ok());
}

/// CBOR writes the number of fields first: if it is wrong, bytes are left, or missing.
#[test]
fn a_map_announces_the_number_of_its_fields() {
    fn is_right(data: &(impl serde::Serialize + ?Sized)) {
        let mut bytes = Vec::new();
        ciborium::into_writer(data, &mut bytes).unwrap();
        let mut rest = &bytes[..];
        let map: ciborium::Value = ciborium::from_reader(&mut rest).unwrap();
        assert!(map.is_map() && rest.is_empty(), "{map:?}");
        // An array or a map of unknown length would end with this.
        assert_eq!(bytes[0] & 0x1F, map.as_map().unwrap().len() as u8);
    }
    let node = NodeId::N1;
    is_right(&Request::Read(&ReadRequest::new(node)));
    is_right(&Request::Write(&WriteRequest::velocity(node, Rps::ZERO)));
    is_right(&Response::Velocity(&VelocityResponse::new(node, Rps::ZERO)));
    let command = MotorControl::turn_left(1, 2).unwrap();
    for bytes in [Ping {}.frame(0).as_bytes(), command.frame(0).as_bytes()] {
        let frame = Frame::parse(bytes).unwrap();
        is_right(frame);
        is_right(&frame.message());
    }
}
