//! The bodies, in the order of their ids (ruling U4). All numbers are little-endian (B5).

use super::codes::{CalibrationKind, ErrorCode, NetworkState, OtaStatus};
use crate::error::EncodeError;

/// Declares bodies: a struct of private byte fields, alignment 1, the id of its message, and the
/// getters whose values `{:?}` shows.
macro_rules! body {
    ($(
        $(#[$meta:meta])*
        pub struct $name:ident($id:ident) { $($field:ident: $ty:ty),* } => $($getter:ident),*;
    )+) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Eq, Hash, PartialEq)]
        #[derive(
            zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::Immutable, zerocopy::KnownLayout,
            zerocopy::Unaligned,
        )]
        #[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(C)]
        pub struct $name { $($field: $ty),* }

        $crate::ucp::frame::debug_values! { $name: $($getter),* }

        impl $crate::ucp::frame::sealed::Sealed for $name {}

        impl $crate::ucp::frame::Body for $name {
            const ID: $crate::ucp::header::MessageId = $crate::ucp::header::MessageId::$id;
        }
    )+};
}
pub(super) use body;

body! {
    /// Host to robot: checks that the robot is there. No body.
    pub struct Ping(Ping) {} =>;

    /// Robot to host, answers a ping: `err`, 1 byte.
    pub struct Pong(Ping) { err: u8 } => err;

    /// Host to robot, begins a calibration: `type`, 1 byte (ruling U11).
    pub struct CalibrationStart(CalibrationStart) { kind: u8 } => kind;

    /// Robot to host, answers the start at once: `type | err`, 2 bytes.
    pub struct CalibrationStartAck(CalibrationStart) { kind: u8, err: u8 } => kind, err;

    /// Host to robot, ends a calibration: `type`, 1 byte (ruling U11).
    pub struct CalibrationEnd(CalibrationEnd) { kind: u8 } => kind;

    /// Robot to host, answers the end at once: `type | err`, 2 bytes.
    ///
    /// The vendor firmware returns the type of the last *start* here.
    pub struct CalibrationEndAck(CalibrationEnd) { kind: u8, err: u8 } => kind, err;

    /// Robot to host, the result of an IMU calibration: `acc: 3 × i16 | gyro: 3 × i16`, 12 bytes.
    ///
    /// Repeated every 1000 ms until acknowledged; the robot does not store it (ruling U11).
    pub struct ImuBias(ImuBias) { acc: [[u8; 2]; 3], gyro: [[u8; 2]; 3] } => acc, gyro;

    /// Host to robot, acknowledges an [`ImuBias`]: `err`, 1 byte.
    pub struct ImuBiasAck(ImuBias) { err: u8 } => err;

    /// Robot to host, the result of a magnetometer calibration: `mag: 3 × i16`, 6 bytes.
    ///
    /// Repeated every 1000 ms until acknowledged; the robot does not store it (ruling U11).
    pub struct MagBias(MagBias) { mag: [[u8; 2]; 3] } => mag;

    /// Host to robot, acknowledges a [`MagBias`]: `err`, 1 byte.
    pub struct MagBiasAck(MagBias) { err: u8 } => err;

    /// Robot to host, asks for the stored biases at boot, every 1000 ms until answered. No body.
    pub struct BiasRequest(Biases) {} =>;

    /// Host to robot, the stored biases: `err | acc: 3 × i16 | gyro: 3 × i16 | mag: 3 × i16`, 19
    /// bytes. The vendor firmware accepts them whatever `err` says.
    pub struct Biases(Biases) {
        err: u8,
        acc: [[u8; 2]; 3],
        gyro: [[u8; 2]; 3],
        mag: [[u8; 2]; 3]
    } => err, imu, mag;

    /// Robot to host, answers an [`OtaRequest`](super::message::OtaRequest): `err`, 1 byte.
    /// Shipped robots never send it.
    pub struct OtaAck(Ota) { status: u8 } => status;

    /// Host to robot, state of the host's network: 1 byte; the form that a host should send (ruling
    /// U8).
    pub struct SetNetworkState(NetworkState) { state: u8 } => state;

    /// Host to robot, state of the host's network in 4 bytes, the size of a Linux `enum`. Only
    /// received, never built.
    pub struct SetNetworkStateWide(NetworkState) { state: [u8; 4] } => state;
}

impl Pong {
    /// Answers a ping.
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether the ping arrived undamaged (ruling U12).
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl CalibrationStart {
    /// Starts a calibration.
    #[must_use]
    pub fn new(kind: CalibrationKind) -> Self {
        Self { kind: kind.into() }
    }

    /// Sensors to be calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }
}

impl CalibrationStartAck {
    /// Answers a [`CalibrationStart`].
    #[must_use]
    pub fn new(kind: CalibrationKind, err: ErrorCode) -> Self {
        Self { kind: kind.into(), err: err.into() }
    }

    /// Sensors being calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }

    /// Whether the request arrived undamaged.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl CalibrationEnd {
    /// Ends a calibration; the result follows later.
    #[must_use]
    pub fn new(kind: CalibrationKind) -> Self {
        Self { kind: kind.into() }
    }

    /// Sensors that were calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }
}

impl CalibrationEndAck {
    /// Answers a [`CalibrationEnd`].
    #[must_use]
    pub fn new(kind: CalibrationKind, err: ErrorCode) -> Self {
        Self { kind: kind.into(), err: err.into() }
    }

    /// Sensors that were calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }

    /// Whether the request arrived undamaged.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl ImuBias {
    /// Biases in the raw units of the [report](super::message::Report): x, y, z.
    #[must_use]
    pub fn new(acc: [i16; 3], gyro: [i16; 3]) -> Self {
        Self { acc: acc.map(i16::to_le_bytes), gyro: gyro.map(i16::to_le_bytes) }
    }

    /// Accelerometer biases x, y, z, raw.
    #[must_use]
    pub fn acc(&self) -> [i16; 3] {
        self.acc.map(i16::from_le_bytes)
    }

    /// Gyroscope biases x, y, z, raw.
    #[must_use]
    pub fn gyro(&self) -> [i16; 3] {
        self.gyro.map(i16::from_le_bytes)
    }
}

impl ImuBiasAck {
    /// Acknowledges an [`ImuBias`].
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether it arrived undamaged; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl MagBias {
    /// Biases in the raw units of the [report](super::message::Report): x, y, z.
    #[must_use]
    pub fn new(mag: [i16; 3]) -> Self {
        Self { mag: mag.map(i16::to_le_bytes) }
    }

    /// Magnetometer biases x, y, z, raw.
    #[must_use]
    pub fn mag(&self) -> [i16; 3] {
        self.mag.map(i16::from_le_bytes)
    }
}

impl MagBiasAck {
    /// Acknowledges a [`MagBias`].
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether it arrived undamaged; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl Biases {
    /// Biases that the host has kept from the last calibrations.
    #[must_use]
    pub fn new(imu: ImuBias, mag: MagBias) -> Self {
        Self { err: ErrorCode::Fine.into(), acc: imu.acc, gyro: imu.gyro, mag: mag.mag }
    }

    /// Normally 0; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }

    /// The same biases with another `err`.
    #[must_use]
    pub fn with_err(self, err: ErrorCode) -> Self {
        Self { err: err.into(), ..self }
    }

    /// The accelerometer and gyroscope part.
    #[must_use]
    pub const fn imu(&self) -> ImuBias {
        ImuBias { acc: self.acc, gyro: self.gyro }
    }

    /// The magnetometer part.
    #[must_use]
    pub const fn mag(&self) -> MagBias {
        MagBias { mag: self.mag }
    }
}

impl OtaAck {
    /// Answers an [`OtaRequest`](super::message::OtaRequest).
    #[must_use]
    pub fn new(status: OtaStatus) -> Self {
        Self { status: status.into() }
    }

    /// The robot's decision on the request.
    #[must_use]
    pub fn status(&self) -> OtaStatus {
        self.status.into()
    }
}

impl SetNetworkState {
    /// Sets the state that the robot's lamp shows.
    ///
    /// # Errors
    ///
    /// [`EncodeError::NetworkState`] for a state above 255, which does not fit into one byte.
    pub fn new(state: NetworkState) -> Result<Self, EncodeError> {
        let value = u32::from(state);
        let state = u8::try_from(value).map_err(|_| EncodeError::NetworkState { value })?;
        Ok(Self { state })
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> NetworkState {
        u32::from(self.state).into()
    }
}

impl SetNetworkStateWide {
    /// The state.
    #[must_use]
    pub fn state(&self) -> NetworkState {
        u32::from_le_bytes(self.state).into()
    }
}
