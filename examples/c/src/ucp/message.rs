//! Messages of the link.

use axlewire::{
    encode::Encode,
    ucp::{
        Body, Frame, MotorControl, RawFrame,
        message::{
            BiasRequest, Biases, CalibrationEnd, CalibrationEndAck, CalibrationStart,
            CalibrationStartAck, DocumentReport, FirmwareReport, ImuBias, ImuBiasAck, MagBias,
            MagBiasAck, Message, OtaAck, OtaRequest, Ping, Pong, Report, SetNetworkState,
        },
    },
};

use super::values::{
    axle_ucp_calibration, axle_ucp_err, axle_ucp_imu_bias, axle_ucp_mag_bias,
    axle_ucp_network_state, axle_ucp_ota_status, axle_ucp_telemetry,
};
use crate::{
    memory::{Out, apart, bytes, bytes_mut, read},
    result::{AXLE_ERROR_STARTS_UPDATE, AXLE_ERROR_VALUE, axle_result, of_encode, of_parse},
};

/// A message of the link. Which fields it has is said with its kind; all others are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ucp_message {
    /// Body of `AXLE_UCP_UNKNOWN`; if parsed, in the frame itself.
    pub body: *const u8,
    /// Its length, bytes.
    pub body_length: usize,
    /// State of the network.
    pub network_state: axle_ucp_network_state,
    /// What is measured.
    pub telemetry: axle_ucp_telemetry,
    /// Biases of the inertial sensors.
    pub imu_bias: axle_ucp_imu_bias,
    /// Biases of the magnetometer.
    pub mag_bias: axle_ucp_mag_bias,
    /// Speed, percent.
    pub speed_pct: i16,
    /// Turn, percent.
    pub turn_pct: i16,
    /// Lamp in front: 100 is on, 0 off.
    pub front_led: i16,
    /// Lamp at the back, as parsed; shipped robots have none.
    pub back_led: i16,
    /// Version: of a report, of an update, or of a motor command, as parsed (ruling U7).
    pub version: i16,
    /// One of `AXLE_UCP_`: the message.
    pub kind: u8,
    /// Id of the frame.
    pub id: u8,
    /// Counter of the sender.
    pub index: u8,
    /// Verdict on the frame that is answered.
    pub err: axle_ucp_err,
    /// Sensors to calibrate.
    pub calibration: axle_ucp_calibration,
    /// Answer to an update request.
    pub ota_status: axle_ucp_ota_status,
}
plain!(axle_ucp_message);

impl Default for axle_ucp_message {
    fn default() -> Self {
        Self {
            body: core::ptr::null(),
            body_length: 0,
            network_state: 0,
            telemetry: Default::default(),
            imu_bias: Default::default(),
            mag_bias: Default::default(),
            speed_pct: 0,
            turn_pct: 0,
            front_led: 0,
            back_led: 0,
            version: 0,
            kind: 0,
            id: 0,
            index: 0,
            err: 0,
            calibration: 0,
            ota_status: 0,
        }
    }
}

kinds! {
    /// The name of a kind of message, such as "report"; "?" for another number.
    axle_ucp_message_name: u8;
    /// Host to robot: checks that the robot is there.
    AXLE_UCP_PING = 1, c"ping";
    /// Robot to host, answers a ping: `err`.
    AXLE_UCP_PONG = 2, c"pong";
    /// Host to robot: `speed_pct`, `turn_pct`, `front_led`.
    AXLE_UCP_MOTOR_CONTROL = 3, c"motor_control";
    /// Host to robot: `calibration`.
    AXLE_UCP_CALIBRATION_START = 4, c"calibration_start";
    /// Robot to host: `calibration`, `err`.
    AXLE_UCP_CALIBRATION_START_ACK = 5, c"calibration_start_ack";
    /// Host to robot: `calibration`.
    AXLE_UCP_CALIBRATION_END = 6, c"calibration_end";
    /// Robot to host: `calibration`, `err`.
    AXLE_UCP_CALIBRATION_END_ACK = 7, c"calibration_end_ack";
    /// Robot to host, as robots send it: `telemetry`, `version` (ruling U5).
    AXLE_UCP_REPORT = 8, c"report";
    /// Robot to host, as in the document: `telemetry` (ruling U5).
    AXLE_UCP_DOCUMENT_REPORT = 9, c"document_report";
    /// Robot to host: the result of a calibration, `imu_bias`.
    AXLE_UCP_IMU_BIAS = 10, c"imu_bias";
    /// Host to robot: `err`.
    AXLE_UCP_IMU_BIAS_ACK = 11, c"imu_bias_ack";
    /// Robot to host: the result of a calibration, `mag_bias`.
    AXLE_UCP_MAG_BIAS = 12, c"mag_bias";
    /// Host to robot: `err`.
    AXLE_UCP_MAG_BIAS_ACK = 13, c"mag_bias_ack";
    /// Robot to host: has booted and wants the stored biases.
    AXLE_UCP_BIAS_REQUEST = 14, c"bias_request";
    /// Host to robot: `imu_bias`, `mag_bias`, `err`.
    AXLE_UCP_BIASES = 15, c"biases";
    /// Host to robot: `version`. Encoding it begins an update: the robot then stops answering.
    AXLE_UCP_OTA_REQUEST = 16, c"ota_request";
    /// Robot to host: `ota_status`.
    AXLE_UCP_OTA_ACK = 17, c"ota_ack";
    /// Host to robot: `network_state`.
    AXLE_UCP_SET_NETWORK_STATE = 18, c"set_network_state";
    /// The same in four bytes, as some hosts send it: `network_state`. Not to be encoded (U8).
    AXLE_UCP_SET_NETWORK_STATE_WIDE = 19, c"set_network_state_wide";
    /// A frame of no known message: `id`, `body`, `body_length` (ruling U3).
    AXLE_UCP_UNKNOWN = 20, c"unknown";
    /// A message that is newer than this header.
    AXLE_UCP_OTHER = 255, c"other";
}

/// Length of the longest frame, bytes.
pub const AXLE_UCP_FRAME_MAX_LENGTH: usize = 64;

const _: () = assert!(AXLE_UCP_FRAME_MAX_LENGTH == axlewire::ucp::MAX_LEN);

/// Writes the frame of a message with its CRC to `to`, which has room for `capacity` bytes, and
/// its length.
///
/// Fails with `AXLE_ERROR_PERCENT`, `AXLE_ERROR_STARTS_UPDATE`, `AXLE_ERROR_NETWORK_STATE`,
/// `AXLE_ERROR_KNOWN_ID`, `AXLE_ERROR_NESTED_HEADER`, `AXLE_ERROR_BODY_TOO_LONG`,
/// `AXLE_ERROR_BUFFER_TOO_SMALL`, `AXLE_ERROR_OVERLAP` if the body is in `to`, or
/// `AXLE_ERROR_VALUE` for an unknown kind, or for a motor command with a version, with a lamp other
/// than 0 and 100, or with a lamp at the back.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_encode(
    message: *const axle_ucp_message,
    to: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> axle_result {
    let encode = || {
        let (message, to, length) = (read(message)?, bytes_mut(to, capacity)?, Out::new(length)?);
        Ok(length.write(encode(&message, to)?))
    };
    encode().unwrap_or_else(|error| error)
}

fn encode(of: &axle_ucp_message, to: &mut [u8]) -> Result<usize, axle_result> {
    let (calibration, err) = (of.calibration.into(), of.err.into());
    let telemetry = of.telemetry.into();
    match of.kind {
        AXLE_UCP_PING => put(Ping {}, of, to),
        AXLE_UCP_PONG => put(Pong::new(err), of, to),
        AXLE_UCP_MOTOR_CONTROL => put(motor_control(of)?, of, to),
        AXLE_UCP_CALIBRATION_START => put(CalibrationStart::new(calibration), of, to),
        AXLE_UCP_CALIBRATION_START_ACK => put(CalibrationStartAck::new(calibration, err), of, to),
        AXLE_UCP_CALIBRATION_END => put(CalibrationEnd::new(calibration), of, to),
        AXLE_UCP_CALIBRATION_END_ACK => put(CalibrationEndAck::new(calibration, err), of, to),
        AXLE_UCP_REPORT => put(FirmwareReport::new(&telemetry, of.version.cast_unsigned()), of, to),
        AXLE_UCP_DOCUMENT_REPORT => put(DocumentReport::new(&telemetry), of, to),
        AXLE_UCP_IMU_BIAS => put(ImuBias::from(of.imu_bias), of, to),
        AXLE_UCP_IMU_BIAS_ACK => put(ImuBiasAck::new(err), of, to),
        AXLE_UCP_MAG_BIAS => put(MagBias::from(of.mag_bias), of, to),
        AXLE_UCP_MAG_BIAS_ACK => put(MagBiasAck::new(err), of, to),
        AXLE_UCP_BIAS_REQUEST => put(BiasRequest {}, of, to),
        AXLE_UCP_BIASES => {
            let biases = Biases::new(of.imu_bias.into(), of.mag_bias.into());
            put(biases.with_err(err), of, to)
        }
        AXLE_UCP_OTA_REQUEST => put(OtaRequest::start_firmware_update(of.version), of, to),
        AXLE_UCP_OTA_ACK => put(OtaAck::new(of.ota_status.into()), of, to),
        AXLE_UCP_SET_NETWORK_STATE => {
            put(SetNetworkState::new(of.network_state.into()).map_err(of_encode)?, of, to)
        }
        AXLE_UCP_UNKNOWN => {
            let body = bytes(of.body, of.body_length)?;
            apart(body, to.as_ptr(), to.len())?;
            written(RawFrame { id: of.id, index: of.index, body }.encode(to))
        }
        _ => Err(AXLE_ERROR_VALUE),
    }
}

/// Never one that starts an update (ruling U7).
fn motor_control(of: &axle_ucp_message) -> Result<MotorControl, axle_result> {
    if of.version > 38 {
        return Err(AXLE_ERROR_STARTS_UPDATE);
    }
    let command = MotorControl::new(of.speed_pct, of.turn_pct).map_err(of_encode)?;
    match (of.version, of.front_led, of.back_led) {
        (0, 0, 0) => Ok(command.with_front_led(false)),
        (0, 100, 0) => Ok(command.with_front_led(true)),
        _ => Err(AXLE_ERROR_VALUE),
    }
}

fn put(body: impl Body, of: &axle_ucp_message, to: &mut [u8]) -> Result<usize, axle_result> {
    written(body.frame(of.index).encode(to))
}

fn written(frame: Result<&[u8], axlewire::error::EncodeError>) -> Result<usize, axle_result> {
    frame.map(<[u8]>::len).map_err(of_encode)
}

/// Reads the message in a frame of exactly these bytes.
///
/// Fails with `AXLE_ERROR_LENGTH`, `AXLE_ERROR_FIELD` or `AXLE_ERROR_CRC`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_parse(
    data: *const u8,
    length: usize,
    message: *mut axle_ucp_message,
) -> axle_result {
    let parse = || {
        let (data, out) = (bytes(data, length)?, Out::new(message)?);
        Ok(out.write(message_of(Frame::parse(data).map_err(of_parse)?)))
    };
    parse().unwrap_or_else(|error| error)
}

fn message_of(frame: &Frame) -> axle_ucp_message {
    let of = |kind| axle_ucp_message {
        kind,
        id: frame.id(),
        index: frame.index(),
        ..Default::default()
    };
    match frame.message() {
        Message::Ping(_) => of(AXLE_UCP_PING),
        Message::Pong(it) => axle_ucp_message { err: it.err().into(), ..of(AXLE_UCP_PONG) },
        Message::MotorControl(it) => axle_ucp_message {
            speed_pct: it.speed(),
            turn_pct: it.angular(),
            front_led: it.front_led(),
            back_led: it.back_led(),
            version: it.version().cast_signed(),
            ..of(AXLE_UCP_MOTOR_CONTROL)
        },
        Message::CalibrationStart(it) => {
            axle_ucp_message { calibration: it.kind().into(), ..of(AXLE_UCP_CALIBRATION_START) }
        }
        Message::CalibrationStartAck(it) => axle_ucp_message {
            calibration: it.kind().into(),
            err: it.err().into(),
            ..of(AXLE_UCP_CALIBRATION_START_ACK)
        },
        Message::CalibrationEnd(it) => {
            axle_ucp_message { calibration: it.kind().into(), ..of(AXLE_UCP_CALIBRATION_END) }
        }
        Message::CalibrationEndAck(it) => axle_ucp_message {
            calibration: it.kind().into(),
            err: it.err().into(),
            ..of(AXLE_UCP_CALIBRATION_END_ACK)
        },
        Message::Report(Report::Firmware(it)) => axle_ucp_message {
            telemetry: it.telemetry().into(),
            version: it.version().cast_signed(),
            ..of(AXLE_UCP_REPORT)
        },
        Message::Report(Report::Document(it)) => {
            axle_ucp_message { telemetry: it.telemetry().into(), ..of(AXLE_UCP_DOCUMENT_REPORT) }
        }
        Message::ImuBias(it) => {
            axle_ucp_message { imu_bias: (*it).into(), ..of(AXLE_UCP_IMU_BIAS) }
        }
        Message::ImuBiasAck(it) => {
            axle_ucp_message { err: it.err().into(), ..of(AXLE_UCP_IMU_BIAS_ACK) }
        }
        Message::MagBias(it) => {
            axle_ucp_message { mag_bias: (*it).into(), ..of(AXLE_UCP_MAG_BIAS) }
        }
        Message::MagBiasAck(it) => {
            axle_ucp_message { err: it.err().into(), ..of(AXLE_UCP_MAG_BIAS_ACK) }
        }
        Message::BiasRequest(_) => of(AXLE_UCP_BIAS_REQUEST),
        Message::Biases(it) => axle_ucp_message {
            imu_bias: it.imu().into(),
            mag_bias: it.mag().into(),
            err: it.err().into(),
            ..of(AXLE_UCP_BIASES)
        },
        Message::OtaRequest(it) => {
            axle_ucp_message { version: it.version(), ..of(AXLE_UCP_OTA_REQUEST) }
        }
        Message::OtaAck(it) => {
            axle_ucp_message { ota_status: it.status().into(), ..of(AXLE_UCP_OTA_ACK) }
        }
        Message::SetNetworkState(it) => {
            axle_ucp_message { network_state: it.state().into(), ..of(AXLE_UCP_SET_NETWORK_STATE) }
        }
        Message::SetNetworkStateWide(it) => axle_ucp_message {
            network_state: it.state().into(),
            ..of(AXLE_UCP_SET_NETWORK_STATE_WIDE)
        },
        Message::Unknown(it) => axle_ucp_message {
            body: it.body.as_ptr(),
            body_length: it.body.len(),
            ..of(AXLE_UCP_UNKNOWN)
        },
        _ => of(AXLE_UCP_OTHER),
    }
}
