//! Bytes on their way to a port that takes them in parts: the outbox of a writer and of a driver.

use heapless::Vec;

use crate::{encode::Encode, error::EncodeError};

/// Bytes that a port has not taken yet, at most `N`.
#[derive(Clone, Debug)]
pub(crate) struct Outbox<const N: usize> {
    unsent: Vec<u8, N>,
}

impl<const N: usize> Outbox<N> {
    pub(crate) const fn new() -> Self {
        Self { unsent: Vec::new() }
    }

    /// The bytes to send.
    pub(crate) fn unsent(&self) -> &[u8] {
        &self.unsent
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.unsent.is_empty()
    }

    /// Puts a frame behind what is still to be sent, or changes nothing.
    pub(crate) fn queue(&mut self, frame: &impl Encode) -> Result<(), EncodeError> {
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

    /// Puts the bytes of a frame behind what is still to be sent; `None` if they do not fit.
    pub(crate) fn extend(&mut self, frame: &[u8]) -> Option<()> {
        self.unsent.extend_from_slice(frame).ok()
    }

    /// The port has taken `count` bytes.
    pub(crate) fn taken(&mut self, count: usize) {
        self.unsent.drain(..count.min(self.unsent.len()));
    }

    /// Gives up what is still to be sent; returns the number of bytes given up.
    pub(crate) fn discard(&mut self) -> usize {
        let discarded = self.unsent.len();
        self.unsent.clear();
        discarded
    }
}
