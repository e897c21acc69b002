//! Bodies (ruling U4): the plain ones, which the table of messages declares, and those that have a
//! rule for what may be sent. All numbers are little-endian (B5).

pub(super) use super::plain::body;
use super::{catalogue::catalogue, codes::*, plain::plain_bodies};
use crate::error::EncodeError;

catalogue! { plain_bodies }

body! {
    /// Host to robot, the stored biases: `err | acc: 3 × i16 | gyro: 3 × i16 | mag: 3 × i16`, 19
    /// bytes. The vendor firmware accepts them whatever `err` says.
    pub struct Biases(Biases) {
        err: u8,
        acc: [[u8; 2]; 3],
        gyro: [[u8; 2]; 3],
        mag: [[u8; 2]; 3]
    } => err, imu, mag;

    /// Host to robot, state of the host's network: 1 byte; the form that a host should send (ruling
    /// U8).
    pub struct SetNetworkState(NetworkState) { state: u8 } => state;

    /// Host to robot, state of the host's network in 4 bytes, the size of a Linux `enum`. Only
    /// received, never built.
    pub struct SetNetworkStateWide(NetworkState) { state: [u8; 4] } => state;
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
