//! Events of a robot.

use crate::ucp::{
    body::Biases,
    codes::{CalibrationKind, NetworkState},
    motor::MotorControl,
};

/// Events of a robot: what the host asks for, and that it has fallen silent.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RobotEvent {
    /// The command has changed, or is back after a [`Watchdog`](Self::Watchdog). In range,
    /// the lamp field 100 or 0, all other fields 0.
    ///
    /// To move the robot, ask [`Robot::command`](super::Robot::command) instead: it is right at any
    /// time. In a queue that fills, only the latest command is sure to be told.
    Motor(MotorControl),
    /// No valid command for 500 ms: speed and turn are 0, the lamp is as it was (ruling U10).
    Watchdog,
    /// A calibration is to begin; it is acknowledged because it is told here (ruling U15).
    CalibrationStart {
        /// What is to be calibrated.
        kind: CalibrationKind,
        /// This calibration is running already: the acknowledgement was lost, or the host has begun
        /// again. A repetition is not told twice while the first event still waits.
        repeated: bool,
    },
    /// The calibration is to end, and its result to be handed in; it is acknowledged because it is
    /// told here. A repetition is no event.
    CalibrationEnd(CalibrationKind),
    /// The host has the IMU biases. If their calibration was still running, it has ended.
    ImuBiasTaken,
    /// The host has the magnetometer biases, likewise.
    MagBiasTaken,
    /// The host has sent the biases that it keeps. The vendor firmware takes them whatever their
    /// `err` says.
    Biases(Biases),
    /// State of the host's network, for the lamp. Also when it has not changed.
    NetworkState(NetworkState),
    /// The host asks for a firmware update. Nothing has been done about it: the application
    /// decides, and says so by [`Robot::answer_update`](super::Robot::answer_update) if it was a
    /// request.
    UpdateRequested {
        /// The version on offer.
        version: i16,
        /// How the host asked.
        by: UpdateSource,
    },
}

/// How a host asks for a firmware update.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateSource {
    /// By the request that is meant for it (id 9).
    Request,
    /// By a motor command whose version is above 38 (ruling U7): on purpose, or because it did not
    /// clear its memory. Speed and turn of such a command are not taken, and it does not feed the
    /// watchdog.
    MotorCommand,
}
