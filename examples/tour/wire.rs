//! Parts one and two: decoding a noisy capture of each protocol, and building one packet of each
//! kind.

use crate::title;
use axlewire::{
    error::EncodeError,
    ikeya::{self, NodeId, Packet, Position, Request, Response, Rps, three},
    stream::{Counters, Decoder, Event, Framing},
    ucp::{self, Body, Message, MotorControl, RawFrame, Telemetry, Ucp},
};

/// Printed parts of a frame: its length, its name and its meaning.
type Line = (usize, &'static str, String);

pub(crate) fn decode_captures() {
    title("Ikeya MD: a capture of an RS485 line with noise");
    decode::<ikeya::BothDirections>(include_bytes!("../captures/ikeya.bin"), ikeya_line);

    title("UCP: a capture of a rover's UART with noise");
    decode::<Ucp>(include_bytes!("../captures/ucp.bin"), ucp_line);
}

pub(crate) fn build_packets() -> Result<(), EncodeError> {
    title("Building one packet of each kind");
    build_ikeya()?;
    println!();
    build_ucp()
}

/// Feeds a capture to a decoder in pieces of 10 bytes, as a serial port would, and prints the
/// events.
fn decode<F: Framing>(capture: &[u8], line: fn(F::Frame<'_>) -> Line) {
    let mut decoder = Decoder::<F, 64>::new();
    let mut offset = 0;
    for mut piece in capture.chunks(10) {
        while let Some(event) = decoder.decode(&mut piece) {
            offset += print(offset, event, line);
        }
    }
    // The capture has ended, so pending bytes will not be completed.
    while decoder.pending() > 0 {
        decoder.idle();
        while let Some(event) = decoder.decode(&mut [].as_slice()) {
            offset += print(offset, event, line);
        }
    }
    account(&decoder.counters(), decoder.pending());
}

/// Prints one event and returns the number of bytes that it covers.
fn print<T>(offset: usize, event: Event<T>, line: fn(T) -> Line) -> usize {
    match event {
        Event::Frame(frame) => {
            let (length, name, meaning) = line(frame);
            println!("{offset:5} {length:4}  {name:<22} {meaning}");
            length
        }
        Event::Skipped(gap) => {
            println!("{offset:5} {:4}  ·· skipped ··          {}", gap.len, why(gap.reason.name()));
            gap.len as usize
        }
    }
}

fn why(reason: &str) -> &str {
    match reason {
        "header" => "no frame starts here",
        "length" => "invalid length",
        "id" => "a complete packet with an invalid node id",
        "crc" => "damaged: CRC mismatch",
        "idle" => "truncated at the end of the capture",
        other => other,
    }
}

fn account(counters: &Counters, pending: usize) {
    let Counters { received, framed, frames, gaps, .. } = counters;
    let skipped = counters.skipped();
    println!(
        "\n{received} bytes = {framed} in {frames} frames + {skipped} in {gaps} gaps + {pending} pending"
    );
}

fn ikeya_line(packet: Packet<'_>) -> Line {
    match packet {
        Packet::Request(Request::Read(it)) => {
            (it.as_bytes().len(), "READ", format!("node {}: status request", it.id()))
        }
        Packet::Request(Request::Write(it)) => {
            let (rps, to) = (it.as_velocity(), it.as_position());
            let meaning = format!(
                "node {}: turn at {rps} rps, or go to {:.4} turns, depending on its mode",
                it.id(),
                to.revolutions()
            );
            (it.as_bytes().len(), "WRITE", meaning)
        }
        Packet::Response(Response::Velocity(it)) => {
            let rps = it.rps();
            let meaning = match Rps::new(rps) {
                Ok(speed) => format!("node {}: {rps} rps = {:.1} rpm", it.id(), speed.rpm()),
                Err(error) => format!("node {}: {error}", it.id()),
            };
            (it.as_bytes().len(), "velocity", meaning)
        }
        Packet::Response(Response::Position(it)) => {
            let at = it.position();
            let meaning =
                format!("node {}: {} counts = {:.4} turns", it.id(), at.counts(), at.revolutions());
            (it.as_bytes().len(), "position", meaning)
        }
    }
}

fn ucp_line(frame: &ucp::Frame) -> Line {
    let (name, meaning) = match frame.message() {
        Message::Ping(_) => ("ping", "keep-alive".into()),
        Message::Pong(it) => ("pong", format!("{:?}", it.err())),
        Message::MotorControl(it) => {
            let lamp = if it.front_led() == 0 { "off" } else { "on" };
            let meaning = format!("speed {} %, angular {}, lamp {lamp}", it.speed(), it.angular());
            ("motor control", meaning)
        }
        Message::CalibrationStart(it) => ("calibration start", format!("{:?}", it.kind())),
        Message::CalibrationStartAck(it) => {
            ("calibration start ack", format!("{:?}, {:?}", it.kind(), it.err()))
        }
        Message::CalibrationEnd(it) => ("calibration end", format!("{:?}", it.kind())),
        Message::CalibrationEndAck(it) => {
            ("calibration end ack", format!("{:?}, {:?}", it.kind(), it.err()))
        }
        Message::Report(it) => {
            let values = it.telemetry();
            let battery = values.battery().map_or("? ".into(), |percent| format!("{percent} "));
            let meaning = format!(
                "#{} battery {battery}%, {:.1} V, {:.2} A, heading {}°, rpm {:?}, acc {:.2?} g",
                frame.index(),
                values.volts(),
                values.amperes(),
                values.heading_deg,
                values.rpm,
                values.acc_g()
            );
            ("report", meaning)
        }
        Message::ImuBias(it) => ("IMU bias", format!("acc {:?}, gyro {:?}", it.acc(), it.gyro())),
        Message::ImuBiasAck(it) => ("IMU bias ack", format!("{:?}", it.err())),
        Message::MagBias(it) => ("magnetometer bias", format!("{:?}", it.mag())),
        Message::MagBiasAck(it) => ("magnetometer bias ack", format!("{:?}", it.err())),
        Message::BiasRequest(_) => ("bias request", "the robot has just booted".into()),
        Message::Biases(it) => {
            let meaning = format!(
                "acc {:?}, gyro {:?}, mag {:?}",
                it.imu().acc(),
                it.imu().gyro(),
                it.mag().mag()
            );
            ("biases", meaning)
        }
        Message::OtaRequest(it) => ("OTA request", format!("version {}", it.version())),
        Message::OtaAck(it) => ("OTA ack", format!("{:?}", it.status())),
        Message::SetNetworkState(it) => ("network state", format!("{:?}", it.state())),
        Message::SetNetworkStateWide(it) => {
            ("network state", format!("{:?}, in four bytes", it.state()))
        }
        Message::Unknown(it) => {
            ("unknown", format!("id {:#04x}, {} bytes of body", it.id, it.body.len()))
        }
        other => ("new to this tour", format!("{other:?}")),
    };
    (frame.as_bytes().len(), name, meaning)
}

fn show(name: &str, bytes: &[u8]) {
    let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    println!("{name:<24} {}", hex.join(" "));
}

fn build_ikeya() -> Result<(), EncodeError> {
    let (rps, position) = (Rps::from_rpm(90.0)?, Position::from_revolutions(-2.25)?);
    show("READ", ikeya::ReadRequest::new(NodeId::N1).as_bytes());
    show("WRITE velocity", ikeya::WriteRequest::velocity(NodeId::N1, rps).as_bytes());
    show("WRITE position", ikeya::WriteRequest::position(NodeId::N3, position).as_bytes());
    show("velocity", ikeya::VelocityResponse::new(NodeId::N1, rps).as_bytes());
    show("position", ikeya::PositionResponse::new(NodeId::N3, position).as_bytes());
    show("3-motor WRITE velocity", three::WriteRequest::velocity(NodeId::N1, [rps; 3]).as_bytes());
    show(
        "3-motor WRITE position",
        three::WriteRequest::position(NodeId::N1, [position; 3]).as_bytes(),
    );
    show("3-motor velocity", three::VelocityResponse::new(NodeId::N1, [rps; 3]).as_bytes());
    show("3-motor position", three::PositionResponse::new(NodeId::N1, [position; 3]).as_bytes());

    // Invalid or dangerous values cannot be built.
    println!("{:<24} {}", "0 / 0 rps", Rps::new(f32::NAN).expect_err("refused"));
    println!(
        "{:<24} {}",
        "40,000 turns",
        Position::from_revolutions(40_000.0).expect_err("refused")
    );
    Ok(())
}

fn build_ucp() -> Result<(), EncodeError> {
    use ucp::message::{CalibrationKind::Imu, ErrorCode::Fine, NetworkState::Connected, OtaStatus};

    let telemetry = Telemetry { battery_pct: 87, voltage_dv: 119, ..Telemetry::default() };
    let (imu, mag) =
        (ucp::message::ImuBias::new([1, 2, 3], [4, 5, 6]), ucp::message::MagBias::new([7, 8, 9]));
    show("ping", ucp::message::Ping {}.frame(0).as_bytes());
    show("pong", ucp::message::Pong::new(Fine).frame(0).as_bytes());
    show(
        "motor control",
        MotorControl::turn_right(60, 20)?.with_front_led(true).frame(1).as_bytes(),
    );
    show("calibration start", ucp::message::CalibrationStart::new(Imu).frame(2).as_bytes());
    show(
        "calibration start ack",
        ucp::message::CalibrationStartAck::new(Imu, Fine).frame(0).as_bytes(),
    );
    show("calibration end", ucp::message::CalibrationEnd::new(Imu).frame(3).as_bytes());
    show(
        "calibration end ack",
        ucp::message::CalibrationEndAck::new(Imu, Fine).frame(0).as_bytes(),
    );
    show(
        "report (firmware)",
        ucp::message::FirmwareReport::new(&telemetry, 38).frame(0).as_bytes(),
    );
    show("report (document)", ucp::message::DocumentReport::new(&telemetry).frame(0).as_bytes());
    show("IMU bias", imu.frame(0).as_bytes());
    show("IMU bias ack", ucp::message::ImuBiasAck::new(Fine).frame(4).as_bytes());
    show("magnetometer bias", mag.frame(0).as_bytes());
    show("magnetometer bias ack", ucp::message::MagBiasAck::new(Fine).frame(5).as_bytes());
    show("bias request", ucp::message::BiasRequest {}.frame(0).as_bytes());
    show("biases", ucp::message::Biases::new(imu, mag).frame(6).as_bytes());
    show("OTA request", ucp::message::OtaRequest::start_firmware_update(39).frame(7).as_bytes());
    show("OTA ack", ucp::message::OtaAck::new(OtaStatus::Forbidden).frame(0).as_bytes());
    if let Ok(state) = ucp::message::SetNetworkState::new(Connected) {
        show("network state", state.frame(8).as_bytes());
    }
    let mut buffer = [0; ucp::MAX_LEN];
    let raw = RawFrame { id: 0x20, index: 9, body: b"hi" };
    show("unknown id", axlewire::encode::Encode::encode(&raw, &mut buffer)?);

    // Frames that hang or move shipped robots cannot be built.
    println!("{:<24} {}", "speed 130 %", MotorControl::new(130, 0).expect_err("refused"));
    let report = RawFrame { id: 5, ..raw };
    let refused = axlewire::encode::Encode::encode(&report, &mut buffer).expect_err("refused");
    println!("{:<24} {refused}", "report from a host");
    Ok(())
}
