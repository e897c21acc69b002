//! Frames in.

use crate::stream::{Decoder, Framing};

/// Events of a stream that comes from a port.
///
/// The port writes straight into the decoder's buffer of `N` bytes: at least [`Framing::MAX_LEN`],
/// more where a read call is expensive, and at most what a [`Decoder`] can have.
///
/// * A read error is passed on and changes nothing: call again.
/// * At an end of file the answer is `None`, and what may still become a frame is kept, because a
///   file can grow and a line can come back. Who knows that nothing follows calls
///   [`idle`](Self::idle) until [`pending`](Self::pending) is 0.
/// * A cancelled `read_event_async` has lost nothing, as long as the port's own `read` loses
///   nothing when it is cancelled: what was read is in the decoder before the next await.
#[derive(Debug)]
pub struct FrameReader<R, F, const N: usize> {
    pub(super) port: R,
    pub(super) decoder: Decoder<F, N>,
}

impl<R, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// Reads from `port`, from the next byte on.
    #[must_use]
    pub const fn new(port: R) -> Self {
        Self { port, decoder: Decoder::new() }
    }

    /// The line went quiet, or the file has ended for good: see [`Decoder::idle`].
    pub fn idle(&mut self) {
        self.decoder.idle();
    }

    /// Bytes received and neither framed nor skipped yet.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.decoder.pending()
    }

    /// The decoder, for its counters.
    #[must_use]
    pub const fn decoder(&self) -> &Decoder<F, N> {
        &self.decoder
    }

    /// The port, to change its settings. Bytes read from it here are lost to the reader.
    pub fn port_mut(&mut self) -> &mut R {
        &mut self.port
    }

    /// The port, and the decoder with what it still holds.
    #[must_use]
    pub fn into_parts(self) -> (R, Decoder<F, N>) {
        (self.port, self.decoder)
    }
}

/// Whatever `F` is: there is none of it in here.
impl<R: Clone, F, const N: usize> Clone for FrameReader<R, F, N> {
    fn clone(&self) -> Self {
        Self { port: self.port.clone(), decoder: self.decoder.clone() }
    }
}
