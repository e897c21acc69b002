//! Frames out.

use crate::{encode::Encode, error::EncodeError, outbox::Outbox};

/// Sends frames through a port.
///
/// A frame is first put whole into a buffer of `N` bytes, then sent from it. After an error or a
/// cancelled future the rest waits there, and the next call goes on with it: no frame is cut and
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

    /// Puts a frame behind what is still to be sent, without touching the port.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] when there is no room for it now, and what the frame itself
    /// refuses. What waits stays as it was.
    pub fn queue(&mut self, frame: &impl Encode) -> Result<(), EncodeError> {
        self.outbox.queue(frame)
    }

    /// Bytes that wait to be sent.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        self.outbox.unsent()
    }

    /// Gives up on what waits; says how many bytes that were.
    pub fn discard(&mut self) -> usize {
        self.outbox.discard()
    }

    /// The port, to change its settings. Bytes sent through it here may land inside a frame.
    pub fn port_mut(&mut self) -> &mut W {
        &mut self.port
    }

    /// The port; what still waits is given up.
    #[must_use]
    pub fn into_port(self) -> W {
        self.port
    }
}
