//! The same calls for `embedded-io-async`.

use embedded_io_async::{Read, Write};

use super::{error::WriteError, reader::FrameReader, writer::FrameWriter};
use crate::{
    encode::Encode,
    stream::{Event, Framing},
};

impl<R: Read, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// Returns the next event; waits for the port if there is none yet. `None` at end of file.
    ///
    /// Cancel safe if the port's `read` is.
    ///
    /// # Errors
    ///
    /// Port errors. No received bytes are lost: the next call continues where this one
    /// stopped.
    pub async fn read_event_async(&mut self) -> Result<Option<Event<F::Frame<'_>>>, R::Error> {
        loop {
            if let Some(found) = self.decoder.advance_held() {
                return Ok(self.decoder.held_event(found));
            }
            let count = self.port.read(self.decoder.spare()).await?;
            if count == 0 {
                return Ok(None);
            }
            self.decoder.commit(count);
        }
    }
}

impl<W: Write, const N: usize> FrameWriter<W, N> {
    /// Sends the unsent bytes, then `frame`, and returns when the port has taken them all. The line
    /// may still be busy; see [`flush_async`](Self::flush_async).
    ///
    /// Cancel safe if the port's `write` is: the next call finishes a frame that was begun. If
    /// cancelled before that, the frame is not queued.
    ///
    /// # Errors
    ///
    /// [`WriteError`]; after [`Port`](WriteError::Port) or [`Zero`](WriteError::Zero) during
    /// `frame`, its rest stays unsent, and [`flush_async`](Self::flush_async) continues with it.
    pub async fn write_async(&mut self, frame: &impl Encode) -> Result<(), WriteError<W::Error>> {
        self.send_async().await?;
        self.queue(frame)?;
        self.send_async().await
    }

    /// Sends the unsent bytes, and returns when the port reports that the last of them is out.
    ///
    /// # Errors
    ///
    /// [`WriteError::Port`] or [`WriteError::Zero`]; the rest stays unsent.
    pub async fn flush_async(&mut self) -> Result<(), WriteError<W::Error>> {
        self.send_async().await?;
        self.port.flush().await.map_err(WriteError::Port)
    }

    async fn send_async(&mut self) -> Result<(), WriteError<W::Error>> {
        while !self.outbox.is_empty() {
            match self.port.write(self.outbox.unsent()).await.map_err(WriteError::Port)? {
                0 => return Err(WriteError::Zero),
                count => self.outbox.taken(count),
            }
        }
        Ok(())
    }
}
