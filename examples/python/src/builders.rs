//! Frames of every message, as bytes: what a test of somebody's firmware sends and expects.

use axlewire::{
    encode::Encode,
    error::EncodeError,
    ikeya::{self, NodeId, Position, ReadRequest, Rps, three},
    ucp::{
        Body, MotorControl, RawFrame, Telemetry,
        message::{
            BiasRequest, Biases, CalibrationEnd, CalibrationEndAck, CalibrationStart,
            CalibrationStartAck, DocumentReport, FirmwareReport, ImuBias, ImuBiasAck, MagBias,
            MagBiasAck, OtaAck, OtaRequest, Ping, Pong, SetNetworkState,
        },
    },
};
use pyo3::{
    Borrowed,
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyBytes, PyDict},
};

type Built<'py> = PyResult<Bound<'py, PyBytes>>;

fn bytes<'py>(py: Python<'py>, frame: impl Encode) -> Built<'py> {
    let mut memory = [0; axlewire::ucp::MAX_LEN];
    Ok(PyBytes::new(py, frame.encode(&mut memory).map_err(refused)?))
}

fn refused(error: EncodeError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A function per message, with its arguments and the body that they make.
macro_rules! messages {
    ($($(#[$doc:meta])* $function:ident($($argument:ident: $type:ty = $default:expr),*) $body:expr;)*) => {
        $($(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = ($($argument = $default,)* *, index = 0))]
        pub(crate) fn $function<'py>(py: Python<'py>, $($argument: $type,)* index: u8) -> Built<'py> {
            bytes(py, $body.frame(index))
        })*
    };
}

messages! {
    /// Host to robot: checks that it is there.
    ucp_ping() Ping {};
    /// Robot to host: answers a ping.
    ucp_pong(err: u8 = 0) Pong::new(err.into());
    /// Host to robot: asks for a calibration, 1 for the magnetometer, 2 for the inertial sensors.
    ucp_calibration_start(kind: u8 = 1) CalibrationStart::new(kind.into());
    /// Robot to host: answers it.
    ucp_calibration_start_ack(kind: u8 = 1, err: u8 = 0)
        CalibrationStartAck::new(kind.into(), err.into());
    /// Host to robot: ends a calibration.
    ucp_calibration_end(kind: u8 = 1) CalibrationEnd::new(kind.into());
    /// Robot to host: answers it.
    ucp_calibration_end_ack(kind: u8 = 1, err: u8 = 0)
        CalibrationEndAck::new(kind.into(), err.into());
    /// Robot to host: the result of a calibration of the inertial sensors.
    ucp_imu_bias(acc: [i16; 3] = [0; 3], gyro: [i16; 3] = [0; 3]) ImuBias::new(acc, gyro);
    /// Host to robot: answers it.
    ucp_imu_bias_ack(err: u8 = 0) ImuBiasAck::new(err.into());
    /// Robot to host: the result of a calibration of the magnetometer.
    ucp_mag_bias(mag: [i16; 3] = [0; 3]) MagBias::new(mag);
    /// Host to robot: answers it.
    ucp_mag_bias_ack(err: u8 = 0) MagBiasAck::new(err.into());
    /// Robot to host: has booted and wants the stored biases.
    ucp_bias_request() BiasRequest {};
    /// Host to robot: the stored biases.
    ucp_biases(acc: [i16; 3] = [0; 3], gyro: [i16; 3] = [0; 3], mag: [i16; 3] = [0; 3], err: u8 = 0)
        Biases::new(ImuBias::new(acc, gyro), MagBias::new(mag)).with_err(err.into());
    /// Host to robot: **starts a firmware update**; the robot then stops answering.
    ucp_ota_request(version: i16 = 0) OtaRequest::start_firmware_update(version);
    /// Robot to host: answers it.
    ucp_ota_ack(status: u8 = 0) OtaAck::new(status.into());
    /// Host to robot: the state of its network, 0 to 255.
    ucp_network_state(state: u32 = 0) SetNetworkState::new(state.into()).map_err(refused)?;
    /// Host to robot: drives, percent of the speed and of turn; -100 to 100.
    ucp_motor_control(speed: i16 = 0, angular: i16 = 0, front_led: bool = false)
        MotorControl::new(speed, angular).map_err(refused)?.with_front_led(front_led);
}

/// The telemetry of these fields: those of a report in a capture, arrays as sequences.
fn telemetry(fields: Option<&Bound<'_, PyDict>>) -> PyResult<Telemetry> {
    let mut of = Telemetry::default();
    for (name, value) in fields.into_iter().flatten() {
        match name.extract::<String>()?.as_str() {
            "battery_pct" => of.battery_pct = value.extract()?,
            "rpm" => of.rpm = value.extract()?,
            "acc" => of.acc = value.extract()?,
            "gyro" => of.gyro = value.extract()?,
            "mag" => of.mag = value.extract()?,
            "heading" | "heading_deg" => of.heading_deg = value.extract()?,
            "power_w" => of.power_w = value.extract()?,
            "voltage_dv" => of.voltage_dv = value.extract()?,
            "current_ca" => of.current_ca = value.extract()?,
            other => return Err(PyTypeError::new_err(format!("a report has no {other}"))),
        }
    }
    Ok(of)
}

/// Robot to host: what it measures. The fields are those of a `Report`: `battery_pct`, `rpm`
/// (four), `acc`, `gyro`, `mag` (three each), `heading`, `power_w`, `voltage_dv`, `current_ca`; all
/// 0 if not given.
#[pyfunction]
#[pyo3(signature = (*, version = 38, index = 0, **fields: "int | Sequence[int]"))]
pub(crate) fn ucp_report<'py>(
    py: Python<'py>,
    version: u16,
    index: u8,
    fields: Option<&Bound<'py, PyDict>>,
) -> Built<'py> {
    bytes(py, FirmwareReport::new(&telemetry(fields)?, version).frame(index))
}

/// The same in the layout of the document (ruling U5).
#[pyfunction]
#[pyo3(signature = (*, index = 0, **fields: "int | Sequence[int]"))]
pub(crate) fn ucp_document_report<'py>(
    py: Python<'py>,
    index: u8,
    fields: Option<&Bound<'py, PyDict>>,
) -> Built<'py> {
    bytes(py, DocumentReport::new(&telemetry(fields)?).frame(index))
}

/// A frame of no known message (rulings U3, U13).
#[pyfunction]
#[pyo3(signature = (id, body = Vec::new(), *, index = 0))]
pub(crate) fn ucp_unknown<'py>(py: Python<'py>, id: u8, body: Vec<u8>, index: u8) -> Built<'py> {
    bytes(py, RawFrame { id, index, body: &body })
}

fn node(id: u8) -> PyResult<NodeId> {
    NodeId::new(id).map_err(refused)
}

/// The values of a board: a number for one motor, three for three.
pub(crate) enum Motors {
    One(f64),
    Three([f64; 3]),
}

impl<'py> FromPyObject<'_, 'py> for Motors {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let one = object.extract().map(Self::One);
        one.or_else(|_| object.extract().map(Self::Three)).map_err(|_| {
            PyTypeError::new_err("a number is needed, or three for a board with three motors")
        })
    }
}

fn rps(value: f64) -> PyResult<Rps> {
    Rps::new(value as f32).map_err(refused)
}

fn turns(value: f64) -> PyResult<Position> {
    let counts = (value * f64::from(Position::COUNTS_PER_REVOLUTION)).round();
    let fits = (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&counts);
    let position = if fits { Position::from_counts(counts as i32).ok() } else { None };
    position.ok_or_else(|| PyValueError::new_err(format!("{value} turns are out of range")))
}

fn each<T>(of: [f64; 3], convert: fn(f64) -> PyResult<T>) -> PyResult<[T; 3]> {
    let [a, b, c] = of;
    Ok([convert(a)?, convert(b)?, convert(c)?])
}

/// Master to slave: asks for the status.
#[pyfunction]
#[pyo3(signature = (id))]
pub(crate) fn ikeya_read(py: Python<'_>, id: u8) -> Built<'_> {
    bytes(py, ReadRequest::new(node(id)?))
}

/// Master to slave: a speed, turns per second; three for a board with three motors.
#[pyfunction]
#[pyo3(signature = (id, velocity: "float | Sequence[float]"))]
pub(crate) fn ikeya_write_velocity(py: Python<'_>, id: u8, velocity: Motors) -> Built<'_> {
    match velocity {
        Motors::One(one) => bytes(py, ikeya::WriteRequest::velocity(node(id)?, rps(one)?)),
        Motors::Three(all) => bytes(py, three::WriteRequest::velocity(node(id)?, each(all, rps)?)),
    }
}

/// Master to slave: a position, turns; three for a board with three motors.
#[pyfunction]
#[pyo3(signature = (id, position: "float | Sequence[float]"))]
pub(crate) fn ikeya_write_position(py: Python<'_>, id: u8, position: Motors) -> Built<'_> {
    match position {
        Motors::One(one) => bytes(py, ikeya::WriteRequest::position(node(id)?, turns(one)?)),
        Motors::Three(all) => {
            bytes(py, three::WriteRequest::position(node(id)?, each(all, turns)?))
        }
    }
}

/// Slave to master: its speed, turns per second; three for a board with three motors.
#[pyfunction]
#[pyo3(signature = (id, velocity: "float | Sequence[float]"))]
pub(crate) fn ikeya_velocity(py: Python<'_>, id: u8, velocity: Motors) -> Built<'_> {
    match velocity {
        Motors::One(one) => bytes(py, ikeya::VelocityResponse::new(node(id)?, rps(one)?)),
        Motors::Three(all) => bytes(py, three::VelocityResponse::new(node(id)?, each(all, rps)?)),
    }
}

/// Slave to master: its position, turns; three for a board with three motors.
#[pyfunction]
#[pyo3(signature = (id, position: "float | Sequence[float]"))]
pub(crate) fn ikeya_position(py: Python<'_>, id: u8, position: Motors) -> Built<'_> {
    match position {
        Motors::One(one) => bytes(py, ikeya::PositionResponse::new(node(id)?, turns(one)?)),
        Motors::Three(all) => bytes(py, three::PositionResponse::new(node(id)?, each(all, turns)?)),
    }
}
