//! Contents of UCP messages, with volts, amperes and percent, and codes by name.

use core::fmt;
use std::io::{self, Write};

use axlewire::ucp::{
    Telemetry,
    message::{CalibrationKind, ErrorCode, NetworkState, OtaStatus},
};

use super::Spaced;
use crate::record::ucp::{Fields, MotorControl};

pub(super) fn contents(out: &mut impl Write, id: u8, fields: &Fields<'_>) -> io::Result<()> {
    match fields {
        Fields::Empty {} => Ok(()),
        Fields::Err { err } => write!(out, "  {}", Named(*err)),
        Fields::MotorControl(command) => motor_control(out, command),
        Fields::Calibration { kind } => write!(out, "  {}", Named(*kind)),
        Fields::CalibrationAck { kind, err } => {
            write!(out, "  {}, {}", Named(*kind), Named(*err))
        }
        Fields::Report { telemetry, version, .. } => report(out, telemetry, *version),
        Fields::ImuBias { acc_bias, gyro_bias } => {
            write!(out, "  acc {}, gyro {}", Spaced(acc_bias), Spaced(gyro_bias))
        }
        Fields::MagBias { mag_bias } => write!(out, "  mag {}", Spaced(mag_bias)),
        Fields::Biases { err, acc_bias, gyro_bias, mag_bias } => write!(
            out,
            "  {}, acc {}, gyro {}, mag {}",
            Named(*err),
            Spaced(acc_bias),
            Spaced(gyro_bias),
            Spaced(mag_bias)
        ),
        Fields::OtaRequest { version } => write!(out, "  version {version}"),
        Fields::OtaAck { err } => write!(out, "  {}", Named(*err)),
        Fields::NetworkState { state, state_width } => {
            write!(out, "  {}, in {state_width} byte{}", Named(*state), plural(*state_width))
        }
        Fields::Unknown { body } => write!(out, "  id {id}, body {body}"),
    }
}

const fn plural(count: u8) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Always prints speed, turn and lamp; the other fields, 0 in an ordinary command, only if nonzero.
fn motor_control(out: &mut impl Write, command: &MotorControl) -> io::Result<()> {
    let MotorControl { speed, angular, front_led, .. } = command;
    write!(out, "  speed {speed:>4} %  angular {angular:>4} %  front led ")?;
    match front_led {
        0 => write!(out, "off")?,
        100 => write!(out, "on")?,
        other => write!(out, "{other}")?,
    }
    let rest: [(&str, i64); 4] = [
        ("back led", command.back_led.into()),
        ("version", command.version.into()),
        ("reserve1", command.reserve1.into()),
        ("reserve2", command.reserve2.into()),
    ];
    for (name, value) in rest {
        if value != 0 {
            write!(out, "  {name} {value}")?;
        }
    }
    if command.starts_update { write!(out, "  (starts a firmware update)") } else { Ok(()) }
}

fn report(out: &mut impl Write, telemetry: &Telemetry, version: Option<u16>) -> io::Result<()> {
    match telemetry.battery() {
        Some(percent) => write!(out, "  battery {percent:>3} %")?,
        None => write!(out, "  battery {} (no percentage)", telemetry.battery_pct)?,
    }
    write!(
        out,
        "  {:>4.1} V  {:>5.2} A  {:>3} W  rpm {:>4}  acc {:>5.2} g  gyro {:>6.1} deg/s  mag {:>5}  \
         heading {:>3} deg",
        telemetry.volts(),
        telemetry.amperes(),
        telemetry.power_w,
        Spaced(&telemetry.rpm),
        Spaced(&telemetry.acc_g()),
        Spaced(&telemetry.gyro_deg_per_s()),
        Spaced(&telemetry.mag),
        telemetry.heading_deg,
    )?;
    match version {
        Some(version) => write!(out, "  firmware {version}"),
        None => write!(out, "  (document layout)"),
    }
}

/// The name of a code, or its number if it has none.
struct Named<T>(T);

impl fmt::Display for Named<ErrorCode> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            ErrorCode::Fine => f.write_str("fine"),
            ErrorCode::Damaged => f.write_str("damaged"),
            ErrorCode::Other(err) => write!(f, "err {err}"),
        }
    }
}

impl fmt::Display for Named<CalibrationKind> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            CalibrationKind::Magnetometer => f.write_str("magnetometer"),
            CalibrationKind::Imu => f.write_str("IMU"),
            CalibrationKind::Other(kind) => write!(f, "type {kind}"),
        }
    }
}

impl fmt::Display for Named<OtaStatus> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            OtaStatus::Accepted => f.write_str("accepted"),
            OtaStatus::Failed => f.write_str("failed"),
            OtaStatus::Forbidden => f.write_str("forbidden"),
            OtaStatus::Other(err) => write!(f, "err {err}"),
        }
    }
}

impl fmt::Display for Named<NetworkState> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            NetworkState::Unknown => f.write_str("unknown"),
            NetworkState::SimAbsent => f.write_str("SIM absent"),
            NetworkState::Disconnected => f.write_str("disconnected"),
            NetworkState::Connected => f.write_str("connected"),
            NetworkState::Ota => f.write_str("firmware update"),
            NetworkState::Other(state) => write!(f, "state {state}"),
        }
    }
}
