//! Errors of a writer.

use core::{error::Error, fmt};

use crate::error::EncodeError;

/// Why a frame was not sent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum WriteError<E> {
    /// The frame cannot be encoded; none of it was sent.
    Encode(EncodeError),
    /// The port failed; the rest of the frame stays unsent.
    Port(E),
    /// The port took no bytes, which the traits forbid; the rest of the frame stays unsent.
    Zero,
}

impl<E: fmt::Display> fmt::Display for WriteError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Encode(error) => write!(f, "frame cannot be encoded: {error}"),
            Self::Port(error) => write!(f, "port failed while sending: {error}"),
            Self::Zero => f.write_str("port took no bytes"),
        }
    }
}

impl<E: Error + 'static> Error for WriteError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Port(error) => error.source(),
            Self::Encode(_) | Self::Zero => None,
        }
    }
}

impl<E> From<EncodeError> for WriteError<E> {
    fn from(error: EncodeError) -> Self {
        Self::Encode(error)
    }
}
