//! The blocking calls.

use embedded_io::{Read, Write};

use super::{error::WriteError, reader::FrameReader, writer::FrameWriter};
use crate::{
    encode::Encode,
    stream::{Event, Framing},
};

impl<R: Read, F: Framing, const N: usize> FrameReader<R, F, N> {
    /// Returns the next event; waits for the port if there is none yet. `None` at end of file.
    ///
    /// # Errors
    ///
    /// Port errors. No received bytes are lost: the next call continues where this one
    /// stopped.
    pub fn read_event(&mut self) -> Result<Option<Event<F::Frame<'_>>>, R::Error> {
        loop {
            if let Some(found) = self.decoder.advance_held() {
                return Ok(self.decoder.held_event(found));
            }
            let count = self.port.read(self.decoder.spare())?;
            if count == 0 {
                return Ok(None);
            }
            self.decoder.commit(count);
        }
    }
}

impl<W: Write, const N: usize> FrameWriter<W, N> {
    /// Sends the unsent bytes, then `frame`, and returns when the port has taken them all. The line
    /// may still be busy; see [`flush`](Self::flush).
    ///
    /// # Errors
    ///
    /// [`WriteError`]; after [`Port`](WriteError::Port) or [`Zero`](WriteError::Zero) during
    /// `frame`, its rest stays unsent, and [`flush`](Self::flush) continues with it.
    pub fn write(&mut self, frame: &impl Encode) -> Result<(), WriteError<W::Error>> {
        self.send()?;
        self.queue(frame)?;
        self.send()
    }

    /// Sends the unsent bytes, and returns when the port reports that the last of them is out.
    ///
    /// # Errors
    ///
    /// [`WriteError::Port`] or [`WriteError::Zero`]; the rest stays unsent.
    pub fn flush(&mut self) -> Result<(), WriteError<W::Error>> {
        self.send()?;
        self.port.flush().map_err(WriteError::Port)
    }

    fn send(&mut self) -> Result<(), WriteError<W::Error>> {
        while !self.outbox.is_empty() {
            match self.port.write(self.outbox.unsent()).map_err(WriteError::Port)? {
                0 => return Err(WriteError::Zero),
                count => self.outbox.taken(count),
            }
        }
        Ok(())
    }
}
