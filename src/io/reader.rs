//! Receiving frames.

use crate::stream::{Decoder, Framing};

/// Reads the events of a stream from a port.
///
/// The port writes straight into the decoder's buffer of `N` bytes: at least [`Framing::MAX_LEN`],
/// more if a read call is expensive, and at most what a [`Decoder`] supports.
///
/// * A read error is passed on and changes nothing: call again.
/// * At end of file the result is `None`, and a possible start of a frame is kept, because a file
///   can grow and a line can come back. If nothing will follow, call [`idle`](Self::idle) until
///   [`pending`](Self::pending) is 0.
/// * An async `read_event` that is dropped loses nothing, as long as the port's own `read` loses
///   nothing when cancelled: received bytes are in the decoder before the next await.
#[derive(Debug)]
pub struct FrameReader<R, F, const N: usize> {
    pub(super) port: R,
    pub(super) decoder: Decoder<F, N>,
}

impl<R, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// Reads from `port`, starting with the next byte.
    #[must_use]
    pub const fn new(port: R) -> Self {
        Self { port, decoder: Decoder::new() }
    }

    /// Tells the decoder that the line went quiet, or that the file has ended for good: see
    /// [`Decoder::idle`].
    pub fn idle(&mut self) {
        self.decoder.idle();
    }

    /// Number of bytes received but neither framed nor skipped yet.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.decoder.pending()
    }

    /// The decoder, for its counters.
    #[must_use]
    pub const fn decoder(&self) -> &Decoder<F, N> {
        &self.decoder
    }

    /// The port, to change its settings. The reader misses bytes that you read from it.
    pub fn port_mut(&mut self) -> &mut R {
        &mut self.port
    }

    /// The port, and the decoder with the bytes that it still holds.
    #[must_use]
    pub fn into_parts(self) -> (R, Decoder<F, N>) {
        (self.port, self.decoder)
    }
}

// By hand: a derive would require `F: Clone`.
impl<R: Clone, F, const N: usize> Clone for FrameReader<R, F, N> {
    fn clone(&self) -> Self {
        Self { port: self.port.clone(), decoder: self.decoder.clone() }
    }
}
