//! Errors of a driver's calls.

use core::{error::Error, fmt};

use crate::error::EncodeError;

#[cfg(feature = "ikeya")]
use crate::ikeya;
#[cfg(feature = "ucp")]
use crate::ucp;

/// Why a call of a driver failed.
///
/// None of these breaks the driver: received and unsent bytes are kept, and the next call
/// continues.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DriveError<E> {
    /// The port failed.
    Port(E),
    /// The port will receive nothing more: an adapter was unplugged, or the other end of a pipe has
    /// gone.
    Closed,
    /// The port took no bytes, which the traits forbid.
    WriteZero,
    /// The port took no byte, or was not flushed, for a second. Async calls only.
    Stalled,
    /// The role handed out a frame longer than the driver's buffer. No role of this crate does.
    FrameTooLong {
        /// Length of the frame, bytes.
        length: usize,
        /// Longest frame that can be sent, bytes.
        limit: usize,
    },
    /// The operation timed out.
    Timeout(Operation),
    /// A value that no frame can have, such as a speed out of range: nothing was sent.
    Value(EncodeError),
    /// The master refuses the command.
    #[cfg(feature = "ikeya")]
    Bus(ikeya::master::CommandError),
    /// The stops of these nodes are not confirmed (ruling I12): they have not answered twice after
    /// a stop WRITE, or have never answered at all. **Their motors may be running.** The stops stay
    /// owed.
    #[cfg(feature = "ikeya")]
    StopsOwed(ikeya::master::NodeSet),
    /// These nodes have confirmed their stop, but were not seen to be still within
    /// [`MasterConfig::coast`](ikeya::master::MasterConfig::coast) (ruling I12): **their motors
    /// move**, or are not where they were told to hold, or the nodes were not heard since. The
    /// stops are repeated as long as the driver is called.
    #[cfg(feature = "ikeya")]
    StillMoving(ikeya::master::NodeSet),
    /// A node could not be read in any of the attempts.
    #[cfg(feature = "ikeya")]
    ReadFailed {
        /// The node.
        node: ikeya::NodeId,
        /// What was received instead of its answer.
        cause: ikeya::master::Cause,
    },
    /// The host refuses the command.
    #[cfg(feature = "ucp")]
    Rover(ucp::host::CommandError),
    /// The robot refused a calibration, or answered none of the attempts.
    #[cfg(feature = "ucp")]
    Calibration(ucp::host::CalibrationFailure),
    /// The robot was not seen to stand still (ruling U16): it sends
    /// [no reports](ucp::host::StopProgress::NoReports), is
    /// [still moving](ucp::host::StopProgress::StillMoving), or was
    /// [not told to stop](ucp::host::StopProgress::NotAsked). **It may be moving.** The host
    /// repeats the stop as long as the driver is called.
    #[cfg(feature = "ucp")]
    NoStandstill(ucp::host::StopProgress),
}

/// The operation that timed out.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Operation {
    /// Discovery of the nodes.
    #[cfg(feature = "ikeya")]
    Discovery,
    /// Sending a set-point.
    #[cfg(feature = "ikeya")]
    SetPoint,
    /// Reading a node.
    #[cfg(feature = "ikeya")]
    Read {
        /// The node.
        node: ikeya::NodeId,
    },
    /// Writing and flushing a stop.
    #[cfg(feature = "ucp")]
    Stop,
    /// Waiting for the answer to a ping.
    #[cfg(feature = "ucp")]
    Ping,
    /// Waiting for the answer to a calibration request.
    #[cfg(feature = "ucp")]
    Calibration,
}

impl<E: fmt::Display> fmt::Display for DriveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(error) => write!(f, "port failed: {error}"),
            Self::Closed => f.write_str("port is closed: the other end has gone"),
            Self::WriteZero => f.write_str("port took no bytes"),
            Self::Stalled => f.write_str("port has stalled for a second"),
            Self::FrameTooLong { length, limit } => {
                write!(f, "frame of {length} bytes is longer than {limit}")
            }
            Self::Timeout(operation) => operation.fmt(f),
            Self::Value(error) => error.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::Bus(error) => error.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::StopsOwed(nodes) => {
                write!(f, "stop of node {nodes} not confirmed: a motor may be running")
            }
            #[cfg(feature = "ikeya")]
            Self::StillMoving(nodes) => {
                write!(f, "node {nodes} was not seen to be still after its stop")
            }
            #[cfg(feature = "ikeya")]
            Self::ReadFailed { node, cause } => {
                let heard = match cause {
                    ikeya::master::Cause::Silent => "nothing was heard",
                    ikeya::master::Cause::Damaged => "only damaged bytes were heard",
                    ikeya::master::Cause::Unexpected => "only other answers were heard",
                    ikeya::master::Cause::Dropped => "its set-point was dropped",
                };
                write!(f, "node {node} did not answer: {heard}")
            }
            #[cfg(feature = "ucp")]
            Self::Rover(error) => error.fmt(f),
            #[cfg(feature = "ucp")]
            Self::NoStandstill(progress) => {
                write!(f, "the robot was not seen to stand still: {progress}")
            }
            #[cfg(feature = "ucp")]
            Self::Calibration(failure) => {
                let ucp::host::CalibrationFailure { step, kind, cause, attempts, .. } = failure;
                let step = match step {
                    ucp::host::CalibrationStep::Start => "start",
                    ucp::host::CalibrationStep::End => "end",
                };
                write!(f, "calibration of {kind:?} did not {step}: ")?;
                match cause {
                    ucp::host::FailureCause::NoAnswer => {
                        write!(f, "no answer to {attempts} requests")
                    }
                    ucp::host::FailureCause::Refused(err) => {
                        write!(f, "the robot answered {err:?}")
                    }
                }
            }
        }
    }
}

impl fmt::Display for Operation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without either protocol there is no operation.
        #[cfg(not(any(feature = "ikeya", feature = "ucp")))]
        let _ = f;
        match *self {
            #[cfg(feature = "ikeya")]
            Self::Discovery => f.write_str("the discovery did not finish in time"),
            #[cfg(feature = "ikeya")]
            Self::SetPoint => f.write_str("the set-point was not sent in time"),
            #[cfg(feature = "ikeya")]
            Self::Read { node } => write!(f, "node {node} was not read in time"),
            #[cfg(feature = "ucp")]
            Self::Stop => f.write_str("the stop was not sent in time: the robot may be driving"),
            #[cfg(feature = "ucp")]
            Self::Ping => f.write_str("the robot did not answer a ping in time"),
            #[cfg(feature = "ucp")]
            Self::Calibration => f.write_str("the robot did not answer a calibration in time"),
        }
    }
}

/// Its text has that of the error inside, whose own source is the next one.
impl<E: Error + 'static> Error for DriveError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Port(error) => error.source(),
            _ => None,
        }
    }
}

#[cfg(feature = "std")]
impl From<std::io::Error> for DriveError<std::io::Error> {
    fn from(error: std::io::Error) -> Self {
        Self::Port(error)
    }
}

impl<E> From<EncodeError> for DriveError<E> {
    fn from(error: EncodeError) -> Self {
        Self::Value(error)
    }
}

#[cfg(feature = "ikeya")]
impl<E> From<ikeya::master::CommandError> for DriveError<E> {
    fn from(error: ikeya::master::CommandError) -> Self {
        Self::Bus(error)
    }
}

#[cfg(feature = "ucp")]
impl<E> From<ucp::host::CommandError> for DriveError<E> {
    fn from(error: ucp::host::CommandError) -> Self {
        match error {
            ucp::host::CommandError::Value(error) => Self::Value(error),
            error => Self::Rover(error),
        }
    }
}
