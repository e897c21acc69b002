//! Why a call of a driver has failed.

use core::{error::Error, fmt};

#[cfg(feature = "ikeya")]
use crate::ikeya;
#[cfg(feature = "ucp")]
use crate::ucp;

/// Why a call of a driver has failed.
///
/// None of these breaks the driver: what was received and what is unsent are kept, and the next
/// call goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DriveError<E> {
    /// The port failed.
    Port(E),
    /// The port says that nothing will be received any more: an adapter was unplugged, the other
    /// end of a pipe has gone.
    Closed,
    /// The port took no bytes, which the traits forbid.
    WriteZero,
    /// The port took no byte, or was not flushed, for a second. Only the async calls can tell.
    Stalled,
    /// A role has handed out a frame that the driver has no room for. No role of this crate does.
    FrameTooLong {
        /// Length of the frame, bytes.
        length: usize,
        /// Longest frame that can be sent, bytes.
        limit: usize,
    },
    /// The operation was not done in its time.
    Timeout(Operation),
    /// The master refuses the command.
    #[cfg(feature = "ikeya")]
    Bus(ikeya::master::CommandError),
    /// The stops of these nodes are not paid (ruling I12): they have not answered twice after a stop
    /// WRITE, or have never answered at all. **Their motors may be running.** The stops stay owed.
    #[cfg(feature = "ikeya")]
    StopsOwed(ikeya::master::NodeSet),
    /// A node could not be read, all attempts included.
    #[cfg(feature = "ikeya")]
    ReadFailed {
        /// Which node.
        node: ikeya::NodeId,
        /// What was heard instead of its answer.
        cause: ikeya::master::Cause,
    },
    /// The host refuses the command.
    #[cfg(feature = "ucp")]
    Rover(ucp::host::CommandError),
    /// The robot did not agree to a calibration, or did not answer, all attempts included.
    #[cfg(feature = "ucp")]
    Calibration(ucp::host::CalibrationFailure),
}

/// The operation that timed out.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Operation {
    /// Asking every id.
    #[cfg(feature = "ikeya")]
    Discovery,
    /// Sending a set-point.
    #[cfg(feature = "ikeya")]
    SetPoint,
    /// Reading a node.
    #[cfg(feature = "ikeya")]
    Read {
        /// Which.
        node: ikeya::NodeId,
    },
    /// Having a stop written and flushed.
    #[cfg(feature = "ucp")]
    Stop,
    /// Having a ping answered.
    #[cfg(feature = "ucp")]
    Ping,
    /// Having a calibration request answered.
    #[cfg(feature = "ucp")]
    Calibration,
}

impl<E: fmt::Display> fmt::Display for DriveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(error) => write!(f, "port failed: {error}"),
            Self::Closed => f.write_str("port is closed: its other end has gone"),
            Self::WriteZero => f.write_str("port took no bytes"),
            Self::Stalled => f.write_str("port has taken nothing for a second"),
            Self::FrameTooLong { length, limit } => {
                write!(f, "frame of {length} bytes is longer than {limit}")
            }
            Self::Timeout(operation) => operation.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::Bus(error) => error.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::StopsOwed(nodes) => {
                write!(f, "no confirmed stop of node {nodes}: a motor may be running")
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
            Self::Calibration(failure) => {
                let ucp::host::CalibrationFailure { step, kind, cause, attempts, .. } = failure;
                let step = match step {
                    ucp::host::CalibrationStep::Start => "begun",
                    ucp::host::CalibrationStep::End => "ended",
                };
                write!(f, "calibration of {kind:?} was not {step}: ")?;
                match cause {
                    ucp::host::FailureCause::NoAnswer => {
                        write!(f, "no answer to {attempts} requests")
                    }
                    ucp::host::FailureCause::Refused(err) => write!(f, "the robot says {err:?}"),
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
            Self::Discovery => f.write_str("the discovery was not done in time"),
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

impl<E: Error + 'static> Error for DriveError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Port(error) => Some(error),
            #[cfg(feature = "ikeya")]
            Self::Bus(error) => Some(error),
            #[cfg(feature = "ucp")]
            Self::Rover(error) => Some(error),
            _ => None,
        }
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
        Self::Rover(error)
    }
}
