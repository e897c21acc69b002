//! Every recorded frame: decoded, compared field by field, encoded back to the same bytes.
//!
//! `tests/vectors/*.jsonl` holds frames that running implementations sent or accepted, one JSON
//! object a line, each with its source.

#![cfg(all(feature = "ikeya", feature = "ucp"))]

use axlewire::ikeya;
use serde_json::Value;

use crate::rig::*;

struct Vector {
    protocol: String,
    /// Towards the slave or the robot.
    down: bool,
    bytes: Vec<u8>,
    fields: Value,
}

fn vectors(file: &str) -> Vec<Vector> {
    let path = format!("{}/tests/vectors/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| vector(&serde_json::from_str(line).unwrap())).collect()
}

fn vector(line: &Value) -> Vector {
    let hex = line["hex"].as_str().unwrap();
    let bytes =
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap());
    Vector {
        protocol: line["protocol"].as_str().unwrap().to_owned(),
        down: matches!(line["dir"].as_str().unwrap(), "master->slave" | "host->stm"),
        bytes: bytes.collect(),
        fields: line["fields"].clone(),
    }
}

fn int<T: TryFrom<i64>>(value: &Value) -> T {
    T::try_from(value.as_i64().unwrap()).ok().unwrap()
}

fn ints<const N: usize>(value: &Value) -> [i16; N] {
    core::array::from_fn(|at| int(&value[at]))
}

fn bits(value: &Value) -> u32 {
    u32::from_str_radix(value.as_str().unwrap(), 16).unwrap()
}

/// Checks that a finite speed encodes as `encode` does, and that no other can be sent.
fn sent_if_finite<T>(speeds: &[f32], encode: impl FnOnce(Vec<Rps>) -> T) -> Option<T> {
    let values: Result<Vec<_>, _> = speeds.iter().map(|&rps| Rps::new(rps)).collect();
    let all_finite = speeds.iter().all(|rps| rps.is_finite());
    match values {
        Ok(values) => {
            assert!(all_finite);
            Some(encode(values))
        }
        Err(error) => {
            assert!(!all_finite && matches!(error, EncodeError::NotFinite { .. }));
            None
        }
    }
}

#[test]
fn every_ikeya_vector_decodes_to_its_fields_and_encodes_back() {
    let (mut standard, mut three_motor, mut refused) = (0, 0, 0);
    for vector in vectors("ikeya.jsonl") {
        let id: u8 = int(&vector.fields["id"]);
        let header: u8 = int(&vector.fields["header"]);
        let reason = if vector.fields["crc_ok"] == false {
            Some(Reason::Crc)
        } else if ![0xAA, 0xBB, 0x55, 0x56].contains(&header) {
            Some(Reason::Header)
        } else if NodeId::new(id).is_err() {
            Some(Reason::Id)
        } else {
            None
        };
        match (vector.protocol.as_str(), vector.down, reason) {
            ("ikeya-md", true, Some(reason)) => is_refused::<ikeya::ToSlave>(&vector, reason),
            ("ikeya-md", false, Some(reason)) => is_refused::<ikeya::ToMaster>(&vector, reason),
            ("ikeya-md-3motor", true, Some(reason)) => {
                is_refused::<three::ToSlave>(&vector, reason)
            }
            ("ikeya-md-3motor", false, Some(reason)) => {
                is_refused::<three::ToMaster>(&vector, reason)
            }
            ("ikeya-md", _, None) => standard_vector(&vector),
            ("ikeya-md-3motor", _, None) => three_motor_vector(&vector),
            other => panic!("{other:?}"),
        }
        match (reason, vector.protocol.as_str()) {
            (Some(_), _) => refused += 1,
            (None, "ikeya-md") => standard += 1,
            (None, _) => three_motor += 1,
        }
    }
    assert_eq!((standard, three_motor, refused), (66, 17, 10));
}

/// Not a frame, and the first byte is skipped for this reason.
fn is_refused<F: Framing>(vector: &Vector, reason: Reason) {
    let mut frames = Frames::<F>::new(&vector.bytes);
    assert!(frames.next().is_none());
    let counters: Counters = frames.counters();
    let expected = if reason == Reason::Id { vector.bytes.len() as u64 } else { 1 };
    assert!(counters.skipped_for(reason) >= expected, "{reason}: {counters:?}");
    let mut decoder = axlewire::stream::Decoder::<F, 64>::new();
    let mut input = &vector.bytes[..];
    assert!(decoder.decode(&mut input).is_none());
    decoder.idle();
    let Some(Event::Skipped(gap)) = decoder.decode(&mut input) else { panic!("no gap") };
    assert_eq!(gap.reason, reason, "{:02x?}", vector.bytes);
}

fn standard_vector(vector: &Vector) {
    let fields = &vector.fields;
    let mut frames = Frames::<BothDirections>::new(&vector.bytes);
    let packet = frames.next().expect("a packet");
    assert_eq!(frames.counters().framed, vector.bytes.len() as u64);
    let id = NodeId::new(int(&fields["id"])).unwrap();
    let position = || Position::new(int(&fields["count"]), int(&fields["rotation"]));
    match packet {
        Packet::Request(Request::Read(read)) => {
            assert_eq!(read.id(), id);
            assert_eq!(ReadRequest::new(id).as_bytes()[..], vector.bytes);
        }
        Packet::Request(Request::Write(write)) => {
            assert_eq!(write.id(), id);
            assert_eq!(write.as_bytes()[..], vector.bytes);
            if fields["rps_bits"].is_string() {
                assert_eq!(write.as_velocity().to_bits(), bits(&fields["rps_bits"]));
                let again = |rps: Vec<Rps>| WriteRequest::velocity(id, rps[0]);
                sent_if_finite(&[write.as_velocity()], again)
                    .inspect(|again| assert_eq!(again, write));
            } else {
                assert_eq!(write.as_position(), position());
                assert_eq!(WriteRequest::position(id, position()), *write);
            }
        }
        Packet::Response(Response::Velocity(response)) => {
            assert_eq!(response.id(), id);
            assert_eq!(response.rps().to_bits(), bits(&fields["rps_bits"]));
            assert_eq!(response.as_bytes()[..], vector.bytes);
            let again = |rps: Vec<Rps>| VelocityResponse::new(id, rps[0]);
            sent_if_finite(&[response.rps()], again).inspect(|again| assert_eq!(again, response));
        }
        Packet::Response(Response::Position(response)) => {
            assert_eq!((response.id(), response.position()), (id, position()));
            assert_eq!(PositionResponse::new(id, position()).as_bytes()[..], vector.bytes);
        }
    }
}

fn three_motor_vector(vector: &Vector) {
    let fields = &vector.fields;
    let mut frames = Frames::<three::BothDirections>::new(&vector.bytes);
    let packet = frames.next().expect("a packet");
    assert_eq!(frames.counters().framed, vector.bytes.len() as u64);
    let id = NodeId::new(int(&fields["id"])).unwrap();
    let speeds = || [0, 1, 2].map(|at| bits(&fields["rps_bits"][at]));
    let positions = || {
        let (count, rotation) = (ints::<3>(&fields["count"]), ints::<3>(&fields["rotation"]));
        [0, 1, 2].map(|at| Position::new(count[at], rotation[at]))
    };
    match packet {
        three::Packet::Request(three::Request::Read(read)) => {
            assert_eq!(ReadRequest::new(id), *read);
            assert_eq!(read.as_bytes()[..], vector.bytes);
        }
        three::Packet::Request(three::Request::Write(write)) => {
            assert_eq!(write.id(), id);
            assert_eq!(write.as_bytes()[..], vector.bytes);
            if fields["rps_bits"].is_array() {
                assert_eq!(write.as_velocity().map(f32::to_bits), speeds());
                let again =
                    |rps: Vec<Rps>| three::WriteRequest::velocity(id, [rps[0], rps[1], rps[2]]);
                sent_if_finite(&write.as_velocity(), again)
                    .inspect(|again| assert_eq!(again, write));
            } else {
                assert_eq!(write.as_position(), positions());
                assert_eq!(three::WriteRequest::position(id, positions()), *write);
            }
        }
        three::Packet::Response(three::Response::Velocity(response)) => {
            assert_eq!(response.id(), id);
            assert_eq!(response.rps().map(f32::to_bits), speeds());
            assert_eq!(response.as_bytes()[..], vector.bytes);
            let again = |rps: Vec<Rps>| three::VelocityResponse::new(id, [rps[0], rps[1], rps[2]]);
            sent_if_finite(&response.rps(), again).inspect(|again| assert_eq!(again, response));
        }
        three::Packet::Response(three::Response::Position(response)) => {
            assert_eq!((response.id(), response.positions()), (id, positions()));
            assert_eq!(three::PositionResponse::new(id, positions()).as_bytes()[..], vector.bytes);
        }
    }
}

#[test]
fn every_ucp_vector_decodes_to_its_fields_and_encodes_back() {
    let mut seen = std::collections::BTreeMap::<String, usize>::new();
    for vector in vectors("ucp.jsonl") {
        let mut frames = Frames::<Ucp>::new(&vector.bytes);
        let frame = frames.next().expect("a frame");
        let trailing = vector.fields["trailing_bytes"].as_str().map_or(0, |hex| hex.len() / 2);
        let whole = &vector.bytes[..vector.bytes.len() - trailing];
        assert_eq!(frame.as_bytes(), whole);
        assert_eq!(frame.id(), int::<u8>(&vector.fields["id"]));
        assert_eq!(frame.index(), int::<u8>(&vector.fields["index"]));
        assert_eq!(frame.header().len(), int::<u16>(&vector.fields["len"]));
        let mut buffer = [0; 64];
        assert_eq!(frame.relay_unchecked().encode(&mut buffer).unwrap(), whole);
        let name = check_ucp_fields(frame, &vector.fields);
        *seen.entry(format!("{name}, {} bytes", frame.as_bytes().len())).or_default() += 1;
    }
    let seen: Vec<_> = seen.into_iter().map(|(name, count)| format!("{count} {name}")).collect();
    assert_eq!(
        seen,
        [
            "2 BiasRequest, 8 bytes",
            "2 Biases, 27 bytes",
            "1 CalibrationEnd, 9 bytes",
            "2 CalibrationEndAck, 10 bytes",
            "5 CalibrationStart, 9 bytes",
            "3 CalibrationStartAck, 10 bytes",
            "3 DocumentReport, 42 bytes",
            "19 FirmwareReport, 44 bytes",
            "4 ImuBias, 20 bytes",
            "2 ImuBiasAck, 9 bytes",
            "3 MagBias, 14 bytes",
            "1 MagBiasAck, 9 bytes",
            "18 MotorControl, 24 bytes",
            "3 OtaAck, 9 bytes",
            "4 OtaRequest, 10 bytes",
            "2 Ping, 8 bytes",
            "2 Pong, 9 bytes",
            "4 SetNetworkState, 9 bytes",
            "3 SetNetworkStateWide, 12 bytes",
            "1 Unknown, 24 bytes",
        ]
    );
}

/// Compares the fields, builds the frame again from them, and names the message.
fn check_ucp_fields(frame: &Frame, fields: &Value) -> &'static str {
    fn built(body: impl Body, index: u8) -> Vec<u8> {
        body.frame(index).as_bytes().to_vec()
    }
    let index = frame.index();
    let err = || ErrorCode::from(int::<u8>(&fields["err"]));
    let kind = || CalibrationKind::from(int::<u8>(&fields["type"]));
    let imu = || ImuBias::new(ints(&fields["acc_bias"]), ints(&fields["gyro_bias"]));
    let mag = || MagBias::new(ints(&fields["mag_bias"]));
    let state = || NetworkState::from(int::<u32>(&fields["state"]));
    let (name, again) = match frame.message() {
        Message::Ping(ping) => ("Ping", built(*ping, index)),
        Message::Pong(pong) => {
            assert_eq!(pong.err(), err());
            ("Pong", built(Pong::new(err()), index))
        }
        Message::MotorControl(command) => ("MotorControl", motor_control(command, fields, index)),
        Message::CalibrationStart(start) => {
            assert_eq!(start.kind(), kind());
            ("CalibrationStart", built(CalibrationStart::new(kind()), index))
        }
        Message::CalibrationStartAck(ack) => {
            assert_eq!((ack.kind(), ack.err()), (kind(), err()));
            ("CalibrationStartAck", built(CalibrationStartAck::new(kind(), err()), index))
        }
        Message::CalibrationEnd(end) => {
            assert_eq!(end.kind(), kind());
            ("CalibrationEnd", built(CalibrationEnd::new(kind()), index))
        }
        Message::CalibrationEndAck(ack) => {
            assert_eq!((ack.kind(), ack.err()), (kind(), err()));
            ("CalibrationEndAck", built(CalibrationEndAck::new(kind(), err()), index))
        }
        Message::Report(report) => telemetry(report, fields, index),
        Message::ImuBias(bias) => {
            let (acc, gyro) = (ints(&fields["acc_bias"]), ints(&fields["gyro_bias"]));
            assert_eq!((bias.acc(), bias.gyro()), (acc, gyro));
            ("ImuBias", built(imu(), index))
        }
        Message::ImuBiasAck(ack) => {
            assert_eq!(ack.err(), err());
            ("ImuBiasAck", built(ImuBiasAck::new(err()), index))
        }
        Message::MagBias(bias) => {
            assert_eq!(bias.mag(), ints(&fields["mag_bias"]));
            ("MagBias", built(mag(), index))
        }
        Message::MagBiasAck(ack) => {
            assert_eq!(ack.err(), err());
            ("MagBiasAck", built(MagBiasAck::new(err()), index))
        }
        Message::BiasRequest(request) => ("BiasRequest", built(*request, index)),
        Message::Biases(biases) => {
            assert_eq!((biases.imu(), biases.mag(), biases.err()), (imu(), mag(), err()));
            ("Biases", built(Biases::new(imu(), mag()).with_err(err()), index))
        }
        Message::OtaRequest(request) => {
            let version = int(&fields["version"]);
            assert_eq!(request.version(), version);
            ("OtaRequest", built(OtaRequest::start_firmware_update(version), index))
        }
        Message::OtaAck(ack) => {
            let status = OtaStatus::from(int::<u8>(&fields["err"]));
            assert_eq!(ack.status(), status);
            ("OtaAck", built(OtaAck::new(status), index))
        }
        Message::SetNetworkState(message) => {
            assert_eq!((message.state(), &fields["state_width"]), (state(), &1.into()));
            ("SetNetworkState", built(SetNetworkState::new(state()).unwrap(), index))
        }
        Message::SetNetworkStateWide(message) => {
            assert_eq!((message.state(), &fields["state_width"]), (state(), &4.into()));
            ("SetNetworkStateWide", built(*message, index))
        }
        Message::Unknown(raw) => {
            assert_eq!(fields["body"].as_str().unwrap(), hex(raw.body));
            // A known id with an invalid body: delivered, never sent (U3, U13).
            let refusal = RawFrame { ..raw }.encode(&mut [0; 64]).unwrap_err();
            assert_eq!(refusal, EncodeError::KnownId { id: frame.id() });
            ("Unknown", frame.as_bytes().to_vec())
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(again, frame.as_bytes(), "{name}");
    name
}

/// Constructors build legal values and refuse illegal ones (U7); a copy keeps every field.
fn motor_control(command: &RawMotorControl, fields: &Value, index: u8) -> Vec<u8> {
    let (speed, angular) = (int::<i16>(&fields["speed"]), int::<i16>(&fields["angular"]));
    assert_eq!((command.speed(), command.angular()), (speed, angular));
    assert_eq!(command.front_led(), int::<i16>(&fields["front_led"]));
    assert_eq!(command.back_led(), int::<i16>(&fields["back_led"]));
    assert_eq!(command.version(), int::<u16>(&fields["version"]));
    assert_eq!(command.reserve1(), int::<u16>(&fields["reserve1"]));
    assert_eq!(command.reserve2(), int::<u32>(&fields["reserve2"]));
    assert_eq!(command.starts_update(), command.version() as i16 > 38);

    let legal = (-100..=100).contains(&speed) && (-100..=100).contains(&angular);
    let built = MotorControl::new(speed, angular);
    assert_eq!(built.is_ok(), legal);
    if let Ok(built) = built {
        let ordinary = built.with_front_led(command.front_led() == 100);
        let reserved = command.back_led() != 0
            || command.version() != 0
            || command.reserve1() != 0
            || command.reserve2() != 0;
        let lamp = ![0, 100].contains(&command.front_led());
        assert_eq!(RawMotorControl::from(ordinary) == *command, !reserved && !lamp);
    }
    assert_eq!(MotorControl::try_from(*command).is_ok(), legal && !command.starts_update());
    frame(2, index, zerocopy::IntoBytes::as_bytes(command))
}

fn telemetry(report: Report<'_>, fields: &Value, index: u8) -> (&'static str, Vec<u8>) {
    let telemetry = Telemetry {
        battery_pct: int(&fields["battery_pct"]),
        rpm: ints(&fields["rpm"]),
        acc: ints(&fields["acc"]),
        gyro: ints(&fields["gyro"]),
        mag: ints(&fields["mag"]),
        heading_deg: int(&fields["heading"]),
        power_w: int(&fields["power_w"]),
        voltage_dv: int(&fields["voltage_dv"]),
        current_ca: int(&fields["current_ca"]),
    };
    assert_eq!(report.telemetry(), telemetry);
    match report {
        Report::Firmware(_) => {
            assert_eq!(fields["layout"], "firmware-36");
            let version = int(&fields["version"]);
            assert_eq!(report.version(), Some(version));
            let again = FirmwareReport::new(&telemetry, version).frame(index);
            ("FirmwareReport", again.as_bytes().to_vec())
        }
        Report::Document(_) => {
            assert_eq!(fields["layout"], "wiki-34");
            assert_eq!(report.version(), None);
            let again = DocumentReport::new(&telemetry).frame(index);
            ("DocumentReport", again.as_bytes().to_vec())
        }
    }
}
