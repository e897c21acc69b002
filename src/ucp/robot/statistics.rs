//! Statistics of a robot.

/// What a robot has seen. Counts stop at 2^32 - 1. What noise has cost is in
/// [`counters`](super::Robot::counters).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct RobotStatistics {
    /// Motor commands taken.
    pub commands: u32,
    /// Motor commands taken with speed or turn cut to -100..=100.
    pub commands_clamped: u32,
    /// Motor commands not taken because they would start a firmware update.
    pub commands_refused: u32,
    /// Times that the watchdog has stopped the robot.
    pub watchdog: u32,
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
