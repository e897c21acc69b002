//! What a host tells its application: events, refusals, figures.

use core::{error::Error, fmt};

use heapless::Vec;

use crate::{
    error::EncodeError,
    time::Duration,
    ucp::{
        CalibrationKind, ErrorCode, ImuBias, MAX_BODY_LEN, MagBias, OtaStatus, RawFrame, Report,
        Telemetry,
    },
};

/// What has happened on the link.
///
/// As large as a raw frame, 60 bytes: reports need two thirds of that, and everything else is rare.
#[derive(Clone, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum HostEvent {
    /// A valid frame of a robot has arrived, the first or the first after
    /// [`LinkDown`](Self::LinkDown).
    LinkUp,
    /// No valid frame of a robot has arrived for the link timeout: since the last one, or at all.
    LinkDown,
    /// The robot has answered a ping.
    Pong {
        /// From the start of the ping to the end of the pong, their wire times included.
        round_trip: Duration,
        /// Whether the ping had arrived undamaged (ruling U12).
        err: ErrorCode,
    },
    /// The robot has reported.
    Report(ReceivedReport),
    /// The application has been silent for too long with the robot on the move: it is being told
    /// to stand still, until the next command (ruling U10).
    DeadMan,
    /// The robot has acknowledged the start of a calibration.
    CalibrationStarted(CalibrationKind),
    /// The robot has acknowledged the end of a calibration; its result follows.
    CalibrationEnded(CalibrationKind),
    /// A calibration request has come to nothing.
    CalibrationFailed(CalibrationFailure),
    /// The result of an IMU calibration, which has been stored. A repetition is no event.
    ///
    /// Without a store that keeps it, this event is the only copy: it is acknowledged because it is
    /// here, and the robot says it again if there was no room (ruling U15).
    ImuBias(ImuBias),
    /// The result of a magnetometer calibration, likewise.
    MagBias(MagBias),
    /// The store has refused the result of this calibration; the robot will send it again.
    BiasNotStored(CalibrationKind),
    /// The robot has booted and gets the stored biases.
    BiasesSent,
    /// The robot has booted and asks for biases, but not all are stored: it is not answered, asks
    /// again in a second, and its measurements are off until it has been calibrated.
    BiasesMissing {
        /// Accelerometer and gyroscope biases are missing.
        imu: bool,
        /// Magnetometer biases are missing.
        mag: bool,
    },
    /// The robot has booted and asks for biases, but
    /// [`HostConfig::low_ids_only`](super::HostConfig::low_ids_only) forbids the answer (ruling
    /// U14). It asks again in a second.
    BiasesNotAnswered,
    /// The robot has answered the request to update its firmware.
    UpdateAnswered(OtaStatus),
    /// A good frame that this crate has no message for (ruling U3).
    Unknown(UnknownFrame),
}

/// A report as it came.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ReceivedReport {
    /// What the robot has measured.
    pub telemetry: Telemetry,
    /// Version of its firmware, where the layout has it.
    pub version: Option<u16>,
    /// The robot's counter of reports, wrapping.
    pub index: u8,
    /// How many reports are missing between the one before and this one.
    pub lost: u8,
}

impl ReceivedReport {
    pub(super) fn new(report: &Report<'_>, index: u8, lost: u8) -> Self {
        Self { telemetry: report.telemetry(), version: report.version(), index, lost }
    }
}

/// A frame without a message, as a copy.
#[derive(Clone, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UnknownFrame {
    id: u8,
    index: u8,
    body: Vec<u8, MAX_BODY_LEN, u8>,
}

impl UnknownFrame {
    /// `None` for a body longer than any that the role's decoder lets through.
    pub(super) fn copy(frame: &RawFrame<'_>) -> Option<Self> {
        let body = Vec::from_slice(frame.body).ok()?;
        Some(Self { id: frame.id, index: frame.index, body })
    }

    /// The frame by its parts.
    #[must_use]
    pub fn as_raw(&self) -> RawFrame<'_> {
        RawFrame { id: self.id, index: self.index, body: &self.body }
    }
}

/// The two requests of a calibration.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationStep {
    /// To begin.
    Start,
    /// To end, and to send the result.
    End,
}

/// A calibration request that came to nothing.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct CalibrationFailure {
    /// Which of the two requests.
    pub step: CalibrationStep,
    /// What was to be calibrated.
    pub kind: CalibrationKind,
    /// Why.
    pub cause: FailureCause,
    /// How often the request was sent.
    pub attempts: u8,
}

impl CalibrationFailure {
    pub(super) const fn new(
        step: CalibrationStep,
        kind: CalibrationKind,
        cause: FailureCause,
        attempts: u8,
    ) -> Self {
        Self { step, kind, cause, attempts }
    }
}

/// Why a request came to nothing: what the last attempt ended in.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FailureCause {
    /// The robot said nothing.
    NoAnswer,
    /// The robot said this instead of [`ErrorCode::Fine`].
    Refused(ErrorCode),
}

/// Why a command was not taken. Whatever was going on goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CommandError {
    /// A speed or turn out of range (ruling U7).
    Value(EncodeError),
    /// A network state above 255, which one byte cannot carry (ruling U8).
    NetworkState {
        /// The state.
        state: u32,
    },
    /// A calibration that no robot knows: it would be acknowledged and do nothing.
    CalibrationKind {
        /// What was asked for.
        kind: u8,
    },
    /// A calibration request is still waiting for its acknowledgement, or its event for room in the
    /// queue.
    Calibrating,
    /// The frame would have an id in 5..=0x0A, and
    /// [`HostConfig::low_ids_only`](super::HostConfig::low_ids_only) forbids those (ruling U14).
    LowIdsOnly {
        /// The id.
        id: u8,
    },
    /// The robot has to be told to stand still before its firmware is updated, and the stop has to
    /// have been [sent](super::Host::is_stop_sent).
    Moving,
    /// The firmware is being updated: this frame would end up in it.
    Updating,
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value(_) => f.write_str("motor command is out of range"),
            Self::NetworkState { state } => {
                write!(f, "network state {state} does not fit into one byte")
            }
            Self::CalibrationKind { kind } => write!(f, "no robot can calibrate {kind}"),
            Self::Calibrating => f.write_str("a calibration request is still unanswered"),
            Self::LowIdsOnly { id } => {
                write!(f, "frames with id {id:#04x} are switched off: this robot may hang on them")
            }
            Self::Moving => f.write_str("the robot has to stand still for a firmware update"),
            Self::Updating => f.write_str("a firmware update is under way"),
        }
    }
}

impl Error for CommandError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Value(error) => Some(error),
            _ => None,
        }
    }
}

/// What a host has seen. Counts stop at 2^32 - 1. What noise has cost is in
/// [`counters`](super::Host::counters).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct HostStatistics {
    /// Motor commands sent.
    pub commands: u32,
    /// Times that the dead-man has stopped the robot.
    pub dead_man: u32,
    /// Times that the link has gone down.
    pub links_lost: u32,
    /// Pings sent.
    pub pings: u32,
    /// Pings that were not answered in time.
    pub pings_lost: u32,
    /// Pongs that say that the ping was damaged, or anything but 0.
    pub pings_damaged: u32,
    /// Pongs that nobody was waiting for, late ones among them.
    pub pongs_unasked: u32,
    /// Round trips of the answered pings.
    pub round_trip: RoundTrip,
    /// Reports received.
    pub reports: u32,
    /// Reports missing by their index.
    pub reports_lost: u32,
    /// Reports with the index of the one before: repeated, or of a robot that does not count.
    pub reports_repeated: u32,
    /// Calibration requests sent again.
    pub calibration_retries: u32,
    /// Calibration requests that came to nothing.
    pub calibration_failures: u32,
    /// Acknowledgements of calibration requests that nobody was waiting for.
    pub acks_unasked: u32,
    /// Calibration results received again.
    pub results_repeated: u32,
    /// Calibration results that the store has refused.
    pub results_not_stored: u32,
    /// Calibration results not acknowledged for want of room for their event: the robot repeats
    /// them.
    pub results_without_room: u32,
    /// Requests for biases received.
    pub bias_requests: u32,
    /// Biases sent.
    pub biases: u32,
    /// Good frames without a message.
    pub unknown: u32,
    /// Frames that only a host sends, such as our own on an echoing line: not looked at.
    pub misdirected: u32,
}

/// How long answers take, microseconds.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RoundTrip {
    count: u32,
    min: u32,
    max: u32,
    sum: u64,
    last: u32,
}

impl RoundTrip {
    pub(super) fn add(&mut self, round_trip: Duration) {
        let micros = round_trip.as_micros();
        self.min = if self.count == 0 { micros } else { self.min.min(micros) };
        self.max = self.max.max(micros);
        self.last = micros;
        // 2^32 spans of 32 bits fit into 64; one more would let the mean drift.
        if let Some(count) = self.count.checked_add(1) {
            self.count = count;
            self.sum += u64::from(micros);
        }
    }

    /// How many were measured.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// The latest; `None` before the first.
    #[must_use]
    pub const fn last(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.last)) }
    }

    /// The fastest; `None` before the first.
    #[must_use]
    pub const fn min(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.min)) }
    }

    /// The slowest; `None` before the first.
    #[must_use]
    pub const fn max(&self) -> Option<Duration> {
        if self.count == 0 { None } else { Some(Duration::from_micros(self.max)) }
    }

    /// The mean, truncated; `None` before the first.
    #[must_use]
    pub const fn mean(&self) -> Option<Duration> {
        match self.sum.checked_div(self.count as u64) {
            Some(mean) => Some(Duration::from_micros(mean as u32)),
            None => None,
        }
    }
}
