//! The same calls for `embedded-io-async`.

use embedded_io_async::{Read, Write};

use super::{error::WriteError, reader::FrameReader, writer::FrameWriter};
use crate::{
    encode::Encode,
    stream::{Event, Framing},
};

impl<R: Read, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// The next event; waits for the port where there is none yet. `None` at an end of file.
    ///
    /// Cancel safe where the port's `read` is.
    ///
    /// # Errors
    ///
    /// The port's own. Nothing that was received is lost: the next call goes on where this one
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
    /// Sends what waits, then `frame`, and returns when the port has taken it all; the line may
    /// still be busy, see [`flush_async`](Self::flush_async).
    ///
    /// Cancel safe where the port's `write` is: a frame that was begun is finished by the next
    /// call. Cancelled before that, the frame is not queued.
    ///
    /// # Errors
    ///
    /// [`WriteError`]; after [`Port`](WriteError::Port) or [`Zero`](WriteError::Zero) during the
    /// frame itself its rest waits, and [`flush_async`](Self::flush_async) goes on with it.
    pub async fn write_async(&mut self, frame: &impl Encode) -> Result<(), WriteError<W::Error>> {
        self.send_async().await?;
        self.queue(frame)?;
        self.send_async().await
    }

    /// Sends what waits, and returns when the port says that its last byte is out.
    ///
    /// # Errors
    ///
    /// [`WriteError::Port`] or [`WriteError::Zero`]; the rest waits on.
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
