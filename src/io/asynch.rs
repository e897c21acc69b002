//! Frames in and out of an async port, over the traits of `embedded-io-async`.
//!
//! [`FrameReader`] and [`FrameWriter`] have the calls of their [blocking namesakes](super), and
//! what those have for both worlds: the decoder, the unsent bytes, the port.

use core::ops::{Deref, DerefMut};

use super::{reader, writer};
use crate::stream::{Decoder, Framing};

/// Reads the events of a stream from an async port: see [`io::FrameReader`](super::FrameReader).
#[derive(Debug)]
pub struct FrameReader<R, F, const N: usize>(pub(super) reader::FrameReader<R, F, N>);

impl<R, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// Reads from `port`, starting with the next byte.
    #[must_use]
    pub const fn new(port: R) -> Self {
        Self(reader::FrameReader::new(port))
    }

    /// The port, and the decoder with the bytes that it still holds.
    #[must_use]
    pub fn into_parts(self) -> (R, Decoder<F, N>) {
        self.0.into_parts()
    }
}

impl<R, F, const N: usize> Deref for FrameReader<R, F, N> {
    type Target = reader::FrameReader<R, F, N>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<R, F, const N: usize> DerefMut for FrameReader<R, F, N> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

// By hand: a derive would require `F: Clone`.
impl<R: Clone, F, const N: usize> Clone for FrameReader<R, F, N> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

/// Sends frames through an async port: see [`io::FrameWriter`](super::FrameWriter).
#[derive(Clone, Debug)]
pub struct FrameWriter<W, const N: usize>(pub(super) writer::FrameWriter<W, N>);

impl<W, const N: usize> FrameWriter<W, N> {
    /// Sends through `port`.
    #[must_use]
    pub const fn new(port: W) -> Self {
        Self(writer::FrameWriter::new(port))
    }

    /// The port. Unsent bytes are discarded.
    #[must_use]
    pub fn into_port(self) -> W {
        self.0.into_port()
    }
}

impl<W, const N: usize> Deref for FrameWriter<W, N> {
    type Target = writer::FrameWriter<W, N>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<W, const N: usize> DerefMut for FrameWriter<W, N> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}
