//! What messages carry.

use axlewire::ucp::{
    MotorControl, Telemetry,
    message::{ImuBias, MagBias},
};

/// A motor command.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_motor {
    /// Speed, percent, -100 to 100 (rulings U6, U7).
    pub speed_pct: i16,
    /// Turn, percent, -100 to 100: a steering wheel, positive to the right (ruling U6).
    pub turn_pct: i16,
    /// Lamp: 0 is off, anything else on.
    pub lamp: u8,
}
plain!(axle_ucp_motor);

impl From<MotorControl> for axle_ucp_motor {
    fn from(command: MotorControl) -> Self {
        Self {
            speed_pct: command.speed(),
            turn_pct: command.angular(),
            lamp: (command.front_led() != 0).into(),
        }
    }
}

/// What a robot measures (ruling U5).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_telemetry {
    /// Battery, percent; invalid above 100.
    pub battery_pct: u16,
    /// Current, 0.01 A. Vendor firmware 38 fills the low byte only.
    pub current_ca: u16,
    /// Acceleration in x, y, z; 16,384 is 1 g.
    pub acc: [i16; 3],
    /// Rotation about x, y, z; 16.4 is 1 degree/s.
    pub gyro: [i16; 3],
    /// Magnetic field in x, y, z: counts of the sensor, whose scale the robot does not tell.
    pub mag: [i16; 3],
    /// Heading, degrees, 0 to 360.
    pub heading_deg: i16,
    /// Wheel speeds, turns per minute: front left, front right, back left, back right.
    pub rpm: [i16; 4],
    /// Voltage, 0.1 V.
    pub voltage_dv: u8,
    /// Power, W.
    pub power_w: u8,
}
plain!(axle_ucp_telemetry);

impl From<Telemetry> for axle_ucp_telemetry {
    fn from(of: Telemetry) -> Self {
        let Telemetry { acc, battery_pct, current_ca, gyro, heading_deg, mag, .. } = of;
        let Telemetry { power_w, rpm, voltage_dv, .. } = of;
        Self { battery_pct, current_ca, acc, gyro, mag, heading_deg, rpm, voltage_dv, power_w }
    }
}

impl From<axle_ucp_telemetry> for Telemetry {
    fn from(of: axle_ucp_telemetry) -> Self {
        let axle_ucp_telemetry { battery_pct, current_ca, acc, gyro, mag, .. } = of;
        let axle_ucp_telemetry { heading_deg, rpm, voltage_dv, power_w, .. } = of;
        Self { battery_pct, current_ca, acc, gyro, mag, heading_deg, rpm, voltage_dv, power_w }
    }
}

/// Biases of the inertial sensors (ruling U11).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_imu_bias {
    /// Acceleration in x, y, z; 16,384 is 1 g.
    pub acc: [i16; 3],
    /// Rotation about x, y, z; 16.4 is 1 degree/s.
    pub gyro: [i16; 3],
}
plain!(axle_ucp_imu_bias);

impl From<ImuBias> for axle_ucp_imu_bias {
    fn from(bias: ImuBias) -> Self {
        Self { acc: bias.acc(), gyro: bias.gyro() }
    }
}

impl From<axle_ucp_imu_bias> for ImuBias {
    fn from(bias: axle_ucp_imu_bias) -> Self {
        Self::new(bias.acc, bias.gyro)
    }
}

/// Biases of the magnetometer (ruling U11).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ucp_mag_bias {
    /// Field in x, y, z: counts of the sensor.
    pub mag: [i16; 3],
}
plain!(axle_ucp_mag_bias);

impl From<MagBias> for axle_ucp_mag_bias {
    fn from(bias: MagBias) -> Self {
        Self { mag: bias.mag() }
    }
}

impl From<axle_ucp_mag_bias> for MagBias {
    fn from(bias: axle_ucp_mag_bias) -> Self {
        Self::new(bias.mag)
    }
}

/// Sensors to calibrate (ruling U11): one of `AXLE_UCP_CALIBRATION_`; other numbers survive.
pub type axle_ucp_calibration = u8;

kinds! {
    /// The name of a calibration, such as "imu"; "?" for another number.
    axle_ucp_calibration_name: axle_ucp_calibration;
    /// The magnetometer; the host must turn the robot meanwhile.
    AXLE_UCP_CALIBRATION_MAGNETOMETER = 1, c"magnetometer";
    /// Accelerometer and gyroscope; the robot must stand still meanwhile.
    AXLE_UCP_CALIBRATION_IMU = 2, c"imu";
}

/// Verdict on a frame that was answered (ruling U12): one of `AXLE_UCP_ERR_`; others survive.
pub type axle_ucp_err = u8;

/// It arrived undamaged.
pub const AXLE_UCP_ERR_FINE: axle_ucp_err = 0;
/// It arrived damaged.
pub const AXLE_UCP_ERR_DAMAGED: axle_ucp_err = 1;

/// Answer to a firmware update request: one of `AXLE_UCP_OTA_`; other numbers survive.
pub type axle_ucp_ota_status = u8;

kinds! {
    /// The name of an answer to an update, such as "accepted"; "?" for another number.
    axle_ucp_ota_status_name: axle_ucp_ota_status;
    /// The update starts.
    AXLE_UCP_OTA_ACCEPTED = 0, c"accepted";
    /// An unknown error.
    AXLE_UCP_OTA_FAILED = 1, c"failed";
    /// Not allowed.
    AXLE_UCP_OTA_FORBIDDEN = 2, c"forbidden";
}

/// State of the host's network (ruling U8): one of `AXLE_UCP_NETWORK_`; other numbers survive.
pub type axle_ucp_network_state = u32;

kinds! {
    /// The name of a state of the network, such as "connected"; "?" for another number.
    axle_ucp_network_state_name: axle_ucp_network_state;
    /// Not known yet.
    AXLE_UCP_NETWORK_UNKNOWN = 0, c"unknown";
    /// No SIM card.
    AXLE_UCP_NETWORK_SIM_ABSENT = 1, c"sim_absent";
    /// No network.
    AXLE_UCP_NETWORK_DISCONNECTED = 2, c"disconnected";
    /// Connected.
    AXLE_UCP_NETWORK_CONNECTED = 3, c"connected";
    /// Firmware update in progress.
    AXLE_UCP_NETWORK_OTA = 4, c"ota";
}

#[cfg(test)]
mod tests {
    use axlewire::ucp::message::{CalibrationKind, ErrorCode, NetworkState, OtaStatus};

    use super::*;

    #[test]
    fn codes_have_their_values_on_the_wire() {
        let kinds = [CalibrationKind::Magnetometer, CalibrationKind::Imu].map(u8::from);
        assert_eq!(kinds, [AXLE_UCP_CALIBRATION_MAGNETOMETER, AXLE_UCP_CALIBRATION_IMU]);
        let errs = [ErrorCode::Fine, ErrorCode::Damaged].map(u8::from);
        assert_eq!(errs, [AXLE_UCP_ERR_FINE, AXLE_UCP_ERR_DAMAGED]);
        let ota = [OtaStatus::Accepted, OtaStatus::Failed, OtaStatus::Forbidden].map(u8::from);
        assert_eq!(ota, [AXLE_UCP_OTA_ACCEPTED, AXLE_UCP_OTA_FAILED, AXLE_UCP_OTA_FORBIDDEN]);
        let states = [
            (NetworkState::Unknown, AXLE_UCP_NETWORK_UNKNOWN),
            (NetworkState::SimAbsent, AXLE_UCP_NETWORK_SIM_ABSENT),
            (NetworkState::Disconnected, AXLE_UCP_NETWORK_DISCONNECTED),
            (NetworkState::Connected, AXLE_UCP_NETWORK_CONNECTED),
            (NetworkState::Ota, AXLE_UCP_NETWORK_OTA),
        ];
        states.into_iter().for_each(|(state, value)| assert_eq!(u32::from(state), value));
    }
}
