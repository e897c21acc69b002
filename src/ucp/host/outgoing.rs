//! The frames that a host sends.

use super::event::CalibrationStep;
use crate::ucp::{
    body::{Biases, SetNetworkState},
    codes::CalibrationKind,
    motor::MotorControl,
};

/// What a frame carries.
#[derive(Clone, Copy, Debug)]
pub(super) enum Outgoing {
    Motor(MotorControl),
    ImuAck,
    MagAck,
    Biases(Biases),
    /// The last says that it is a repetition.
    Calibration(CalibrationStep, CalibrationKind, bool),
    Network(SetNetworkState),
    Update(i16),
    Ping,
}
