//! `{:?}` shows values, not bytes.

use axlewire::ucp::message::RawOtaRequest;

use crate::rig::*;

#[track_caller]
fn shows(value: impl core::fmt::Debug, text: &str) {
    assert_eq!(format!("{value:?}"), text);
}

#[test]
fn packets_show_speeds_and_positions() {
    let (rps, position) = (Rps::new(1.5).unwrap(), Position::new(4096, 1));
    let read = ReadRequest::new(NodeId::N1);
    shows(Packet::Request(Request::Read(&read)), "Request(Read(ReadRequest { id: N1 }))");
    shows(
        WriteRequest::velocity(NodeId::N1, rps),
        "WriteRequest { id: N1, velocity: 1.5, position: Position { count: 0, rotation: 16320 } }",
    );
    shows(VelocityResponse::new(NodeId::N2, rps), "VelocityResponse { id: N2, rps: 1.5 }");
    shows(
        PositionResponse::new(NodeId::N3, position),
        "PositionResponse { id: N3, position: Position { count: 4096, rotation: 1 } }",
    );
    shows(
        three::VelocityResponse::new(NodeId::N3, [rps, Rps::ZERO, rps]),
        "VelocityResponse { id: N3, rps: [1.5, 0.0, 1.5] }",
    );
}

#[test]
fn messages_show_the_values_of_their_fields() {
    let command = MotorControl::new(50, -3).unwrap().with_front_led(true);
    shows(command, "MotorControl { speed: 50, angular: -3, front_led: 100 }");
    shows(
        RawMotorControl::from(command),
        "RawMotorControl { speed: 50, angular: -3, front_led: 100, back_led: 0, version: 0, \
         reserve1: 0, reserve2: 0 }",
    );
    shows(
        Biases::new(ImuBias::new([1, 2, 3], [4, 5, 6]), MagBias::new([7, 8, 9])),
        "Biases { err: Fine, imu: ImuBias { acc: [1, 2, 3], gyro: [4, 5, 6] }, \
         mag: MagBias { mag: [7, 8, 9] } }",
    );
    let request = OtaRequest::start_firmware_update(-2);
    shows(request, "OtaRequest { version: -2 }");
    shows(RawOtaRequest::from(request), "RawOtaRequest { version: -2 }");
}

#[test]
fn frames_show_id_index_and_message() {
    let sent = CalibrationStart::new(CalibrationKind::Imu).frame(7);
    shows(sent, "FrameOf { index: 7, body: CalibrationStart { kind: Imu } }");
    let received = Frame::parse(sent.as_bytes()).unwrap();
    shows(
        received,
        "Frame { id: 3, index: 7, message: CalibrationStart(CalibrationStart { kind: Imu }) }",
    );
    shows(received.header(), "Header { len: 5, id: 3, index: 7 }");
    let ping = Ping {}.frame(0);
    shows(Frame::parse(ping.as_bytes()).unwrap(), "Frame { id: 1, index: 0, message: Ping(Ping) }");
}
