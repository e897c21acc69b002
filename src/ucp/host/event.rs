//! Events and command errors of a host.

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

/// An event of a host.
///
/// As large as a raw frame, 60 bytes: reports need two thirds of that, and all other events are
/// rare.
#[derive(Clone, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum HostEvent {
    /// A valid frame of a robot has arrived, either the first or the first after
    /// [`LinkDown`](Self::LinkDown).
    LinkUp,
    /// No valid frame of a robot has arrived within the link timeout, since the last one or at all.
    /// A robot that was told to move is told to stand still (ruling U16).
    LinkDown,
    /// The robot has answered a ping.
    Pong {
        /// Time from the start of the ping to the end of the pong, their wire times included.
        round_trip: Duration,
        /// Whether the ping arrived undamaged (ruling U12).
        err: ErrorCode,
    },
    /// The robot has sent a report.
    Report(ReceivedReport),
    /// The application has been silent for too long while the robot was moving: the host tells the
    /// robot to stand still until the next command (ruling U10).
    DeadMan,
    /// The robot has acknowledged the start of a calibration.
    CalibrationStarted(CalibrationKind),
    /// The robot has acknowledged the end of a calibration; its result follows.
    CalibrationEnded(CalibrationKind),
    /// A calibration request has failed.
    CalibrationFailed(CalibrationFailure),
    /// The result of an IMU calibration has been stored. A repetition causes no event, unless a
    /// calibration was started since.
    ///
    /// If the store does not keep it, this event is the only copy. The result is acknowledged
    /// because the event was queued; without room, the robot repeats it (ruling U15).
    ImuBias(ImuBias),
    /// The same for a magnetometer calibration.
    MagBias(MagBias),
    /// The store has refused the result of this calibration; the robot will send it again.
    BiasNotStored(CalibrationKind),
    /// The robot has booted, and the host answers with the stored biases.
    BiasesSent,
    /// The robot has booted and asks for biases, but not all are stored: the host does not answer.
    /// The robot asks again after a second, and its measurements are off until it has been
    /// calibrated.
    BiasesMissing {
        /// Whether accelerometer and gyroscope biases are missing.
        imu: bool,
        /// Whether magnetometer biases are missing.
        mag: bool,
    },
    /// The robot has booted and asks for biases, but
    /// [`HostConfig::low_ids_only`](super::HostConfig::low_ids_only) forbids the answer (ruling
    /// U14). The robot asks again after a second.
    BiasesNotAnswered,
    /// A firmware update was given up: its request was not sent, because the robot was no longer
    /// seen to stand still, or because the port did not take it whole. Ask again once
    /// [`stop_progress`](crate::ucp::Host::stop_progress) shows a standstill.
    UpdateNotSent,
    /// The robot has answered a firmware update request; which one it does not say. It
    /// changes nothing in what the host sends.
    UpdateAnswered(OtaStatus),
    /// A good frame for which this crate has no message (ruling U3).
    Unknown(UnknownFrame),
}

/// A report as received.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ReceivedReport {
    /// The robot's measurements.
    pub telemetry: Telemetry,
    /// Version of the robot's firmware, if the layout has it.
    pub version: Option<u16>,
    /// The robot's wrapping report counter.
    pub index: u8,
    /// Number of reports missing between the previous one and this one.
    pub lost: u8,
}

impl ReceivedReport {
    pub(super) fn new(report: &Report<'_>, index: u8, lost: u8) -> Self {
        Self { telemetry: report.telemetry(), version: report.version(), index, lost }
    }
}

/// A copy of a frame for which this crate has no message.
#[derive(Clone, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UnknownFrame {
    id: u8,
    index: u8,
    body: Vec<u8, MAX_BODY_LEN, u8>,
}

impl UnknownFrame {
    /// Copies a frame; `None` if its body is longer than the role's decoder lets through.
    pub(super) fn copy(frame: &RawFrame<'_>) -> Option<Self> {
        let body = Vec::from_slice(frame.body).ok()?;
        Some(Self { id: frame.id, index: frame.index, body })
    }

    /// The frame given by its parts.
    #[must_use]
    pub fn as_raw(&self) -> RawFrame<'_> {
        RawFrame { id: self.id, index: self.index, body: &self.body }
    }
}

/// The two requests of a calibration.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationStep {
    /// To start the calibration.
    Start,
    /// To end the calibration and send the result.
    End,
}

/// A calibration request that has failed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct CalibrationFailure {
    /// The request that failed.
    pub step: CalibrationStep,
    /// The sensors to be calibrated.
    pub kind: CalibrationKind,
    /// The cause.
    pub cause: FailureCause,
    /// Number of times the request was sent.
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

/// Cause of a failed request: the outcome of its last attempt.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FailureCause {
    /// The robot did not answer.
    NoAnswer,
    /// The robot answered with a code other than [`ErrorCode::Fine`].
    Refused(ErrorCode),
}

/// Reason for refusing a command. The command has no effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CommandError {
    /// A speed, a turn or a network state out of range (rulings U7, U8).
    Value(EncodeError),
    /// A kind of calibration that no robot knows: it would be acknowledged without effect.
    CalibrationKind {
        /// The kind asked for.
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
    /// A firmware update requires reports that show the robot at a standstill, behind a stop
    /// ([`Host::stop_progress`](crate::ucp::Host::stop_progress)).
    Moving,
    /// A firmware update is in progress: the frame would end up in it.
    Updating,
    /// The [link](super::Link) is down: a robot that is not heard is not driven (ruling U16).
    LinkDown,
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value(error) => error.fmt(f),
            Self::CalibrationKind { kind } => write!(f, "no robot can calibrate {kind}"),
            Self::Calibrating => f.write_str("a calibration request is still unanswered"),
            Self::LowIdsOnly { id } => {
                write!(f, "frames with id {id:#04x} are disabled: this robot may hang on them")
            }
            Self::Moving => {
                f.write_str("a firmware update needs a robot that is seen to stand still")
            }
            Self::Updating => f.write_str("a firmware update is in progress"),
            Self::LinkDown => f.write_str("the robot is not heard"),
        }
    }
}

impl Error for CommandError {}
