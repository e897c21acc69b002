//! What a robot tells its application: events and figures.

use crate::ucp::{Biases, CalibrationKind, MotorControl, NetworkState};

/// Events of a robot: what the host asks for, and that it has fallen silent.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RobotEvent {
    /// The command has changed, or is back after a [`WatchdogStop`](Self::WatchdogStop). In range,
    /// the lamp field 100 or 0, all other fields 0.
    ///
    /// To move the robot, ask [`Robot::command`](super::Robot::command) instead: it is right at any
    /// time. In a queue that fills, only the latest command is sure to be told.
    Motor(MotorControl),
    /// No valid command for 500 ms: speed and turn are 0, the lamp is as it was (ruling U10).
    WatchdogStop,
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

/// What a robot has seen. Counts stop at 2^32 - 1. What noise has cost is in
/// [`counters`](super::Robot::counters).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct RobotStatistics {
    /// Motor commands taken.
    pub commands: u32,
    /// Motor commands taken with speed or turn cut to -100..=100.
    pub commands_clamped: u32,
    /// Motor commands not taken because they would start a firmware update.
    pub commands_refused: u32,
    /// Times that the watchdog has stopped the robot.
    pub watchdog_stops: u32,
    /// Pings received.
    pub pings: u32,
    /// Pongs sent. Pings that arrive together are answered together, so these can be fewer.
    pub pongs: u32,
    /// Reports sent.
    pub reports: u32,
    /// Reports not sent because the driver came a period or more too late.
    pub reports_skipped: u32,
    /// Starts of a calibration that was running already.
    pub calibration_repeats: u32,
    /// Calibration requests of a kind that there is not, or to end what is not under way, be it
    /// because the acknowledgement of the end was lost: acknowledged and without effect.
    pub calibration_refused: u32,
    /// Calibration results sent, repetitions included.
    pub results: u32,
    /// Acknowledgements of results that were not waited for, or that say that the result was
    /// damaged.
    pub acks_refused: u32,
    /// Requests, biases and acknowledgements not taken for want of room for their event: what
    /// expects an answer gets none, and the host says it again (ruling U15).
    pub without_room: u32,
    /// Requests for biases sent.
    pub bias_requests: u32,
    /// Good frames without a message.
    pub unknown: u32,
    /// Frames that only a robot sends, such as our own on an echoing line: not looked at (U13).
    pub misdirected: u32,
}
