//! Counts of a host.

use crate::stats::Latency;

/// Counts of a host. They saturate at 2^32 - 1. Bytes lost to noise are in
/// [`counters`](crate::ucp::Host::counters).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct HostStatistics {
    /// Motor commands sent.
    pub commands: u32,
    /// Number of times the dead-man has stopped the robot.
    pub dead_man: u32,
    /// Number of times the link has gone down.
    pub links_lost: u32,
    /// Pings sent.
    pub pings: u32,
    /// Pings that were not answered in time.
    pub pings_lost: u32,
    /// Pongs that report a damaged ping, or any code other than 0.
    pub pings_damaged: u32,
    /// Pongs while no ping was waiting for one. A late pong counts as that of the next ping.
    pub pongs_unasked: u32,
    /// Round trips of the answered pings.
    pub round_trip: Latency,
    /// Reports received.
    pub reports: u32,
    /// Reports missing, according to their index.
    pub reports_lost: u32,
    /// Reports with the same index as the previous one: repeated, or from a robot that does not
    /// count.
    pub reports_repeated: u32,
    /// Calibration requests sent again.
    pub calibration_retries: u32,
    /// Calibration requests that failed.
    pub calibration_failures: u32,
    /// Acknowledgements of calibration requests that were not expected.
    pub acks_unasked: u32,
    /// Calibration results received again.
    pub results_repeated: u32,
    /// Calibration results that the store has refused.
    pub results_not_stored: u32,
    /// Calibration results not acknowledged because there was no room for their event: the robot
    /// repeats them.
    pub results_without_room: u32,
    /// Requests for biases received.
    pub bias_requests: u32,
    /// Biases sent.
    pub biases: u32,
    /// Good frames for which this crate has no message.
    pub unknown: u32,
    /// Frames that only a host sends, such as our own on an echoing line: ignored.
    pub misdirected: u32,
}
