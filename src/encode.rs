//! Encoding of frames.

use crate::error::EncodeError;

/// A whole frame that can be sent, CRC included.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::{encode::Encode, ikeya::{NodeId, ReadRequest}};
///
/// let mut buffer = [0; 8];
/// let bytes = ReadRequest::new(NodeId::N1).encode(&mut buffer)?;
/// assert_eq!(bytes, [0xAA, 0x01, 0xBE, 0xD0]);
/// # }
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
pub trait Encode {
    /// Length of the frame, bytes.
    fn encoded_len(&self) -> usize;

    /// Writes the frame to the front of `buffer` and returns just those bytes.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] if the frame does not fit, or the type's own error. `buffer`
    /// is then unchanged.
    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError>;
}

/// Copies a finished frame to the front of `buffer`.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
pub(crate) fn encode_bytes<'b>(
    frame: &[u8],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let available = buffer.len();
    let target = buffer
        .get_mut(..frame.len())
        .ok_or(EncodeError::BufferTooSmall { needed: frame.len(), available })?;
    target.copy_from_slice(frame);
    Ok(target)
}
