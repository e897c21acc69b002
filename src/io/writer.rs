//! Sending frames.

use crate::{encode::Encode, error::EncodeError, outbox::Outbox};

/// Sends frames through a port.
///
/// A frame is first put whole into a buffer of `N` bytes, then sent from it. After an error or a
/// cancelled future the rest stays there, and the next call continues with it: no frame is cut and
/// none is sent twice, as long as the port's own `write` does neither.
#[derive(Clone, Debug)]
pub struct FrameWriter<W, const N: usize> {
    pub(super) port: W,
    pub(super) outbox: Outbox<N>,
}

impl<W, const N: usize> FrameWriter<W, N> {
    /// Sends through `port`.
    #[must_use]
    pub const fn new(port: W) -> Self {
        Self { port, outbox: Outbox::new() }
    }

    /// Appends a frame to the unsent bytes, without using the port.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] if there is no room for it now, or an error of the frame
    /// itself. The unsent bytes are unchanged.
    pub fn queue(&mut self, frame: &impl Encode) -> Result<(), EncodeError> {
        self.outbox.queue(frame)
    }

    /// The unsent bytes.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        self.outbox.unsent()
    }

    /// Discards the unsent bytes; returns their number.
    pub fn discard(&mut self) -> usize {
        self.outbox.discard()
    }

    /// The port, to change its settings. Bytes that you send through it may land inside a frame.
    pub fn port_mut(&mut self) -> &mut W {
        &mut self.port
    }

    /// The port. Unsent bytes are discarded.
    #[must_use]
    pub fn into_port(self) -> W {
        self.port
    }
}
