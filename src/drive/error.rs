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
    /// A role has handed out a frame that the driver has no room for. No role of this crate does.
    FrameTooLong {
        /// Length of the frame, bytes.
        length: usize,
        /// Longest frame that can be sent, bytes.
        limit: usize,
    },
    /// The call was not fulfilled in its time.
    Timeout(Wish),
    /// The master refuses the command.
    #[cfg(feature = "ikeya")]
    Bus(ikeya::CommandError),
    /// A node could not be read, all attempts included.
    #[cfg(feature = "ikeya")]
    ReadFailed {
        /// Which node.
        node: ikeya::NodeId,
        /// What was heard instead of its answer.
        cause: ikeya::Cause,
    },
    /// The host refuses the command.
    #[cfg(feature = "ucp")]
    Rover(ucp::CommandError),
    /// The robot did not agree to a calibration, or did not answer, all attempts included.
    #[cfg(feature = "ucp")]
    Calibration(ucp::CalibrationFailure),
}

/// What was not fulfilled in its time.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Wish {
    /// To have asked every id.
    #[cfg(feature = "ikeya")]
    Discovery,
    /// To have sent a set-point.
    #[cfg(feature = "ikeya")]
    SetPoint,
    /// To have read a node.
    #[cfg(feature = "ikeya")]
    Read {
        /// Which.
        node: ikeya::NodeId,
    },
    /// To have a ping answered.
    #[cfg(feature = "ucp")]
    Ping,
    /// To have a calibration request answered.
    #[cfg(feature = "ucp")]
    Calibration,
}

impl<E: fmt::Display> fmt::Display for DriveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(error) => write!(f, "port failed: {error}"),
            Self::Closed => f.write_str("port is closed: its other end has gone"),
            Self::WriteZero => f.write_str("port took no bytes"),
            Self::FrameTooLong { length, limit } => {
                write!(f, "frame of {length} bytes is longer than {limit}")
            }
            Self::Timeout(wish) => wish.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::Bus(error) => error.fmt(f),
            #[cfg(feature = "ikeya")]
            Self::ReadFailed { node, cause } => {
                let heard = match cause {
                    ikeya::Cause::Silent => "nothing was heard",
                    ikeya::Cause::Damaged => "only damaged bytes were heard",
                    ikeya::Cause::Unexpected => "only other answers were heard",
                };
                write!(f, "node {node} did not answer: {heard}")
            }
            #[cfg(feature = "ucp")]
            Self::Rover(error) => error.fmt(f),
            #[cfg(feature = "ucp")]
            Self::Calibration(failure) => {
                let ucp::CalibrationFailure { step, kind, cause, attempts, .. } = failure;
                let step = match step {
                    ucp::CalibrationStep::Start => "begun",
                    ucp::CalibrationStep::End => "ended",
                };
                write!(f, "calibration of {kind:?} was not {step}: ")?;
                match cause {
                    ucp::FailureCause::NoAnswer => {
                        write!(f, "no answer to {attempts} requests")
                    }
                    ucp::FailureCause::Refused(err) => write!(f, "the robot says {err:?}"),
                }
            }
        }
    }
}

impl fmt::Display for Wish {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without either protocol there is nothing to wish for.
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
impl<E> From<ikeya::CommandError> for DriveError<E> {
    fn from(error: ikeya::CommandError) -> Self {
        Self::Bus(error)
    }
}

#[cfg(feature = "ucp")]
impl<E> From<ucp::CommandError> for DriveError<E> {
    fn from(error: ucp::CommandError) -> Self {
        Self::Rover(error)
    }
}
