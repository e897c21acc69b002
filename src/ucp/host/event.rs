//! Events of a host, and its refusals.

use core::{error::Error, fmt};

use heapless::Vec;

use crate::{
    error::EncodeError,
    time::Duration,
    ucp::{
        body::{ImuBias, MagBias},
        codes::{CalibrationKind, ErrorCode, OtaStatus},
        frame::RawFrame,
        header::MAX_BODY_LEN,
        report::{Report, Telemetry},
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
    /// A speed, a turn or a network state out of range (rulings U7, U8).
    Value(EncodeError),
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
            Self::Value(_) => f.write_str("the value is out of range"),
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
