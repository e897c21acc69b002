//! Messages between a rover's Linux board and its robot.

use axlewire::ucp::{
    self, Message, RawFrame, Telemetry,
    message::{CalibrationKind, ErrorCode, NetworkState, OtaStatus, Report},
};
use serde::Serialize;

use super::Hex;

/// One frame.
#[derive(Debug, Serialize)]
pub(crate) struct Frame<'a> {
    pub(crate) length: usize,
    pub(crate) protocol: &'static str,
    pub(crate) message: &'static str,
    pub(crate) id: u8,
    pub(crate) index: u8,
    #[serde(flatten)]
    pub(crate) fields: Fields<'a>,
}

/// Contents of a message; codes print as their wire values.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Fields<'a> {
    /// Ping, bias request: no body.
    Empty {},
    /// Pong and the acknowledgements of biases.
    Err {
        err: ErrorCode,
    },
    MotorControl(MotorControl),
    Calibration {
        #[serde(rename = "type")]
        kind: CalibrationKind,
    },
    CalibrationAck {
        #[serde(rename = "type")]
        kind: CalibrationKind,
        err: ErrorCode,
    },
    Report {
        layout: &'static str,
        #[serde(flatten, with = "TelemetryNames")]
        telemetry: Telemetry,
        #[serde(skip_serializing_if = "Option::is_none")]
        version: Option<u16>,
    },
    ImuBias {
        acc_bias: [i16; 3],
        gyro_bias: [i16; 3],
    },
    MagBias {
        mag_bias: [i16; 3],
    },
    Biases {
        err: ErrorCode,
        acc_bias: [i16; 3],
        gyro_bias: [i16; 3],
        mag_bias: [i16; 3],
    },
    OtaRequest {
        version: i16,
    },
    OtaAck {
        err: OtaStatus,
    },
    NetworkState {
        state: NetworkState,
        state_width: u8,
    },
    Unknown {
        body: Hex<'a>,
    },
}

/// Speed, turn and lamps.
#[derive(Debug, Serialize)]
pub(crate) struct MotorControl {
    pub(crate) speed: i16,
    pub(crate) angular: i16,
    pub(crate) front_led: i16,
    pub(crate) back_led: i16,
    pub(crate) version: u16,
    pub(crate) reserve1: u16,
    pub(crate) reserve2: u32,
    /// For the human-readable listing: whether a shipped robot treats it as a firmware update
    /// (ruling U7).
    #[serde(skip)]
    pub(crate) starts_update: bool,
}

/// JSON names of a report's values.
#[derive(Serialize)]
#[serde(remote = "Telemetry")]
struct TelemetryNames {
    battery_pct: u16,
    rpm: [i16; 4],
    acc: [i16; 3],
    gyro: [i16; 3],
    mag: [i16; 3],
    #[serde(rename = "heading")]
    heading_deg: i16,
    power_w: u8,
    voltage_dv: u8,
    current_ca: u16,
}

impl<'a> From<&'a ucp::Frame> for super::Frame<'a> {
    fn from(frame: &'a ucp::Frame) -> Self {
        let (message, fields) = fields(frame);
        Self::Ucp(Frame {
            length: frame.as_bytes().len(),
            protocol: "ucp",
            message,
            id: frame.id(),
            index: frame.index(),
            fields,
        })
    }
}

/// Name and fields of the message in `frame`.
fn fields(frame: &ucp::Frame) -> (&'static str, Fields<'_>) {
    match frame.message() {
        Message::Ping(_) => ("ping", Fields::Empty {}),
        Message::Pong(body) => ("pong", Fields::Err { err: body.err() }),
        Message::MotorControl(body) => ("motor_control", motor_control(body)),
        Message::CalibrationStart(body) => {
            ("calibration_start", Fields::Calibration { kind: body.kind() })
        }
        Message::CalibrationStartAck(body) => {
            ("calibration_start_ack", Fields::CalibrationAck { kind: body.kind(), err: body.err() })
        }
        Message::CalibrationEnd(body) => {
            ("calibration_end", Fields::Calibration { kind: body.kind() })
        }
        Message::CalibrationEndAck(body) => {
            ("calibration_end_ack", Fields::CalibrationAck { kind: body.kind(), err: body.err() })
        }
        Message::Report(body) => ("report", report(body)),
        Message::ImuBias(body) => {
            ("imu_bias", Fields::ImuBias { acc_bias: body.acc(), gyro_bias: body.gyro() })
        }
        Message::ImuBiasAck(body) => ("imu_bias_ack", Fields::Err { err: body.err() }),
        Message::MagBias(body) => ("mag_bias", Fields::MagBias { mag_bias: body.mag() }),
        Message::MagBiasAck(body) => ("mag_bias_ack", Fields::Err { err: body.err() }),
        Message::BiasRequest(_) => ("bias_request", Fields::Empty {}),
        Message::Biases(body) => ("biases", biases(body)),
        Message::OtaRequest(body) => {
            ("ota_request", Fields::OtaRequest { version: body.version() })
        }
        Message::OtaAck(body) => ("ota_ack", Fields::OtaAck { err: body.status() }),
        Message::SetNetworkState(body) => {
            ("network_state", Fields::NetworkState { state: body.state(), state_width: 1 })
        }
        Message::SetNetworkStateWide(body) => {
            ("network_state", Fields::NetworkState { state: body.state(), state_width: 4 })
        }
        Message::Unknown(RawFrame { body, .. }) => ("unknown", Fields::Unknown { body: Hex(body) }),
        // A message that only a newer library knows: its raw bytes.
        _ => ("unknown", Fields::Unknown { body: Hex(frame.body()) }),
    }
}

fn motor_control(body: &ucp::message::RawMotorControl) -> Fields<'static> {
    Fields::MotorControl(MotorControl {
        speed: body.speed(),
        angular: body.angular(),
        front_led: body.front_led(),
        back_led: body.back_led(),
        version: body.version(),
        reserve1: body.reserve1(),
        reserve2: body.reserve2(),
        starts_update: body.starts_update(),
    })
}

fn report(body: Report<'_>) -> Fields<'static> {
    let layout = match body {
        Report::Firmware(_) => "firmware",
        Report::Document(_) => "document",
    };
    Fields::Report { layout, telemetry: body.telemetry(), version: body.version() }
}

fn biases(body: &ucp::message::Biases) -> Fields<'static> {
    Fields::Biases {
        err: body.err(),
        acc_bias: body.imu().acc(),
        gyro_bias: body.imu().gyro(),
        mag_bias: body.mag().mag(),
    }
}
