//! Counts of a robot.

/// Counts of the robot. They saturate at 2^32 - 1. Bytes lost to noise are in
/// [`counters`](crate::ucp::Robot::counters).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct RobotStatistics {
    /// Motor commands accepted.
    pub commands: u32,
    /// Motor commands accepted with speed or turn clamped to -100..=100.
    pub commands_clamped: u32,
    /// Motor commands refused because they would start a firmware update.
    pub commands_refused: u32,
    /// Number of times the watchdog has stopped the robot.
    pub watchdog: u32,
    /// Pings received.
    pub pings: u32,
    /// Pongs sent. Pings that arrive together share one pong, so there may be fewer.
    pub pongs: u32,
    /// Reports sent.
    pub reports: u32,
    /// Reports not sent because the driver was a period or more late.
    pub reports_skipped: u32,
    /// Starts of a calibration that was already running.
    pub calibration_repeats: u32,
    /// Calibration requests of unknown kind, or ending a calibration that is not running, perhaps
    /// because the acknowledgement of its end was lost: acknowledged without effect.
    pub calibration_refused: u32,
    /// Calibration results sent, repetitions included.
    pub results: u32,
    /// Acknowledgements of results that were not expected, or that report a damaged result.
    pub acks_refused: u32,
    /// Requests, biases and acknowledgements not accepted because there was no room for their
    /// event: they are not acknowledged, and the host repeats them (ruling U15).
    pub without_room: u32,
    /// Requests for biases sent.
    pub bias_requests: u32,
    /// Good frames for which this crate has no message.
    pub unknown: u32,
    /// Frames that only a robot sends, such as our own on an echoing line: ignored (U13).
    pub misdirected: u32,
}
