//! Frames in and out of a port, over the traits of `embedded-io` and `embedded-io-async`.
//!
//! [`FrameReader`] and [`FrameWriter`] are thin: they move bytes between a port and the decoder or a
//! small buffer, and add no rule of their own. What has been received stays in the reader through
//! read errors, ends of file and cancelled futures; what could not be sent stays in the writer.
//!
//! Both have their blocking calls with feature `embedded-io`, and the same calls with `_async`
//! behind the name with feature `embedded-io-async`.
//!
//! ```
//! # #[cfg(all(feature = "embedded-io", feature = "ucp"))] {
//! use axlewire::{io::{FrameReader, FrameWriter}, stream::Event, ucp::{message::Ping, Body, Ucp}};
//!
//! let mut line = [0; 16];
//! let mut writer = FrameWriter::<_, 64>::new(&mut line[..]);
//! writer.write(&Ping {}.frame(7))?;
//!
//! let mut reader = FrameReader::<_, Ucp, 64>::new(&line[..]);
//! let Some(Event::Frame(frame)) = reader.read_event()? else { panic!() };
//! assert_eq!((frame.id(), frame.index()), (1, 7));
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::{error::Error, fmt};

use crate::{
    encode::Encode,
    error::EncodeError,
    stream::{Decoder, Framing},
};

#[cfg(feature = "embedded-io-async")]
mod asynch;
#[cfg(feature = "embedded-io")]
mod blocking;

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
    port: R,
    decoder: Decoder<F, N>,
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

/// Sends frames through a port.
///
/// A frame is first put whole into a buffer of `N` bytes, then sent from it. After an error or a
/// cancelled future the rest waits there, and the next call goes on with it: no frame is cut and
/// none is sent twice, as long as the port's own `write` does neither.
#[derive(Clone, Debug)]
pub struct FrameWriter<W, const N: usize> {
    port: W,
    unsent: heapless::Vec<u8, N>,
}

impl<W, const N: usize> FrameWriter<W, N> {
    /// Sends through `port`.
    #[must_use]
    pub const fn new(port: W) -> Self {
        Self { port, unsent: heapless::Vec::new() }
    }

    /// Puts a frame behind what is still to be sent, without touching the port.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] when there is no room for it now, and what the frame itself
    /// refuses. What waits stays as it was.
    pub fn queue(&mut self, frame: &impl Encode) -> Result<(), EncodeError> {
        let (start, needed) = (self.unsent.len(), frame.encoded_len());
        let too_small = EncodeError::BufferTooSmall { needed, available: N - start };
        self.unsent.resize_default(start.saturating_add(needed)).map_err(|_| too_small)?;
        let room = self.unsent.get_mut(start..).unwrap_or_default();
        let encoded = frame.encode(room).map(drop);
        if encoded.is_err() {
            self.unsent.truncate(start);
        }
        encoded
    }

    /// Bytes that wait to be sent.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        &self.unsent
    }

    /// Gives up on what waits; says how many bytes that were.
    pub fn discard(&mut self) -> usize {
        let discarded = self.unsent.len();
        self.unsent.clear();
        discarded
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

    /// The port has taken `count` bytes.
    fn sent(&mut self, count: usize) {
        self.unsent.drain(..count.min(self.unsent.len()));
    }
}

/// Why a frame has not been sent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum WriteError<E> {
    /// The frame cannot be encoded; nothing of it was sent.
    Encode(EncodeError),
    /// The port failed; the rest of the frame waits.
    Port(E),
    /// The port took no bytes, which the traits forbid; the rest of the frame waits.
    Zero,
}

impl<E: fmt::Display> fmt::Display for WriteError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Encode(error) => write!(f, "frame not encoded: {error}"),
            Self::Port(error) => write!(f, "port failed while sending: {error}"),
            Self::Zero => f.write_str("port took no bytes"),
        }
    }
}

impl<E: Error + 'static> Error for WriteError<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Encode(error) => Some(error),
            Self::Port(error) => Some(error),
            Self::Zero => None,
        }
    }
}

impl<E> From<EncodeError> for WriteError<E> {
    fn from(error: EncodeError) -> Self {
        Self::Encode(error)
    }
}
