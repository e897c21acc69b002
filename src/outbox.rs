//! Bytes for a port that takes them in parts: the outbox of a writer and of a driver.

use heapless::Vec;

use crate::{encode::Encode, error::EncodeError};

/// At most `N` bytes that a port has not taken yet.
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

    /// Appends a frame, or changes nothing.
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

    /// Appends the bytes of a frame; `None` if they do not fit.
    pub(crate) fn extend(&mut self, frame: &[u8]) -> Option<()> {
        self.unsent.extend_from_slice(frame).ok()
    }

    /// Removes `count` bytes, which the port has taken.
    pub(crate) fn taken(&mut self, count: usize) {
        self.unsent.drain(..count.min(self.unsent.len()));
    }

    /// Discards the unsent bytes; returns their number.
    pub(crate) fn discard(&mut self) -> usize {
        let discarded = self.unsent.len();
        self.unsent.clear();
        discarded
    }
}
