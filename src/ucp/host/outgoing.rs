//! The frames that a host sends.

use super::event::CalibrationStep;
use crate::ucp::{
    body::{Biases, SetNetworkState},
    codes::CalibrationKind,
    motor::MotorControl,
};

/// Content of a frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Outgoing {
    Motor(MotorControl),
    ImuAck,
    MagAck,
    Biases(Biases),
    /// The flag marks a repetition.
    Calibration(CalibrationStep, CalibrationKind, bool),
    Network(SetNetworkState),
    /// The request of a firmware update to this version.
    Update(i16),
    Ping,
}
