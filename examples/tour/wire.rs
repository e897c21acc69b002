//! Parts one and two: decoding a noisy capture of each protocol, and building one packet of each
//! kind.

use core::fmt::Display;

use crate::title;
use axlewire::{
    error::EncodeError,
    ikeya::{self, NodeId, Position, Rps, three},
    stream::{Counters, Decoder, Framing},
    ucp::{self, Body, MotorControl, RawFrame, Telemetry, Ucp},
};

pub(crate) fn decode_captures() {
    title("Ikeya MD: a capture of an RS485 line with noise");
    decode::<ikeya::BothDirections>(include_bytes!("../captures/ikeya.bin"));

    title("UCP: a capture of a rover's UART with noise");
    decode::<Ucp>(include_bytes!("../captures/ucp.bin"));
}

pub(crate) fn build_packets() -> Result<(), EncodeError> {
    title("Building one packet of each kind");
    build_ikeya()?;
    println!();
    build_ucp()
}

/// Feeds a capture to a decoder in pieces of 10 bytes, as a serial port would, and prints the
/// events.
fn decode<F>(capture: &[u8])
where
    F: Framing,
    for<'a> F::Frame<'a>: Display,
{
    let mut decoder = Decoder::<F, 64>::new();
    let mut offset = 0;
    for mut piece in capture.chunks(10) {
        drain(&mut decoder, &mut piece, &mut offset);
    }
    // The capture has ended, so pending bytes will not be completed.
    while decoder.pending() > 0 {
        decoder.idle();
        drain(&mut decoder, &mut [].as_slice(), &mut offset);
    }
    account(&decoder.counters(), decoder.pending());
}

/// Prints the events in `bytes`, each behind its offset: frames and gaps print themselves.
fn drain<F>(decoder: &mut Decoder<F, 64>, bytes: &mut &[u8], offset: &mut u64)
where
    F: Framing,
    for<'a> F::Frame<'a>: Display,
{
    loop {
        match decoder.decode(bytes) {
            Some(event) => println!("{offset:5}  {event}"),
            None => return,
        }
        // The event ends where the counted bytes end.
        let counters = decoder.counters();
        *offset = counters.framed + counters.skipped();
    }
}

fn account(counters: &Counters, pending: usize) {
    let Counters { received, framed, frames, gaps, .. } = counters;
    let skipped = counters.skipped();
    println!(
        "\n{received} bytes = {framed} in {frames} frames + {skipped} in {gaps} gaps + {pending} pending"
    );
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
