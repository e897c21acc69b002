//! Events of a robot.

use crate::ucp::{
    body::Biases,
    codes::{CalibrationKind, NetworkState},
    motor::MotorControl,
};

/// An event of a robot.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RobotEvent {
    /// The command has changed, or is back after a [`Watchdog`](Self::Watchdog). It is in range,
    /// the lamp field is 100 or 0, and all other fields are 0.
    ///
    /// To move the robot, use [`Robot::command`](crate::ucp::Robot::command) instead: it is correct
    /// at any time. In a queue that fills up, only the latest command is sure to be reported.
    /// One that the watchdog has ended before it was reported is reported with 0 for speed and
    /// turn.
    Motor(MotorControl),
    /// No valid command for 500 ms: speed and turn are 0, the lamp is unchanged (ruling U10).
    Watchdog,
    /// A calibration is to start. The start is acknowledged because this event was queued (ruling
    /// U15).
    CalibrationStart {
        /// The sensors to calibrate.
        kind: CalibrationKind,
        /// Whether this calibration is already running: the acknowledgement was lost, or the host
        /// has started again. A repetition is not reported while the first event is still waiting.
        repeated: bool,
    },
    /// The calibration is to end, and its result to be handed in. The end is acknowledged because
    /// this event was queued. A repetition causes no event.
    CalibrationEnd(CalibrationKind),
    /// The host has the IMU biases. If their calibration was still running, it has ended.
    ImuBiasTaken,
    /// The same for the magnetometer biases.
    MagBiasTaken,
    /// The host has sent its stored biases. The vendor firmware accepts them whatever their `err`
    /// says.
    Biases(Biases),
    /// State of the host's network, for the lamp; reported even if it has not changed.
    NetworkState(NetworkState),
    /// The host asks for a firmware update. The role does nothing about it: the application
    /// decides, and answers a [`Request`](UpdateSource::Request) with
    /// [`Robot::answer_update`](crate::ucp::Robot::answer_update).
    UpdateRequested {
        /// The version offered.
        version: i16,
        /// How the host asked.
        by: UpdateSource,
    },
}

/// How a host asks for a firmware update.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateSource {
    /// By the dedicated request (id 9).
    Request,
    /// By a motor command with a version above 38 (ruling U7): on purpose, or because the host did
    /// not clear its memory. Speed and turn of such a command are ignored, and it does not feed the
    /// watchdog.
    MotorCommand,
}
