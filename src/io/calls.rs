//! The calls, written once for both worlds.

use super::{error::WriteError, reader::FrameReader, writer::FrameWriter};
use crate::{
    encode::Encode,
    stream::{Event, Framing},
};

/// The calls of these types, for ports with these traits.
macro_rules! calls {
    ($Reader:ident, $Read:path, $Writer:ident, $Write:path, [$($async:tt)?], [$($await:tt)*]) => {
impl<R: $Read, F: Framing, const N: usize> $Reader<R, F, N> {
    /// Returns the next event; waits for the port if there is none yet. `None` at end of file.
    ///
    /// An async `read_event` can be dropped if the `read` of the port can.
    ///
    /// # Errors
    ///
    /// Port errors. No received bytes are lost: the next call continues where this one
    /// stopped.
    pub $($async)? fn read_event(&mut self) -> Result<Option<Event<F::Frame<'_>>>, R::Error> {
        let FrameReader { port, decoder }: &mut FrameReader<R, F, N> = self;
        loop {
            if let Some(found) = decoder.advance_held() {
                return Ok(decoder.held_event(found));
            }
            let count = port.read(decoder.spare())$($await)*?;
            if count == 0 {
                return Ok(None);
            }
            decoder.commit(count);
        }
    }
}

impl<W: $Write, const N: usize> $Writer<W, N> {
    /// Sends the unsent bytes, then `frame`, and returns when the port has taken them all. The line
    /// may still be busy; see [`flush`](Self::flush).
    ///
    /// An async `write` that is dropped during an earlier frame has not queued this one.
    ///
    /// # Errors
    ///
    /// [`WriteError`]; after [`Port`](WriteError::Port) or [`Zero`](WriteError::Zero) during
    /// `frame`, its rest stays unsent, and [`flush`](Self::flush) continues with it.
    pub $($async)? fn write(&mut self, frame: &impl Encode) -> Result<(), WriteError<W::Error>> {
        self.send()$($await)*?;
        self.queue(frame)?;
        self.send()$($await)*
    }

    /// Sends the unsent bytes, and returns when the port reports that the last of them is out.
    ///
    /// # Errors
    ///
    /// [`WriteError::Port`] or [`WriteError::Zero`]; the rest stays unsent.
    pub $($async)? fn flush(&mut self) -> Result<(), WriteError<W::Error>> {
        self.send()$($await)*?;
        self.port.flush()$($await)*.map_err(WriteError::Port)
    }

    $($async)? fn send(&mut self) -> Result<(), WriteError<W::Error>> {
        let FrameWriter { port, outbox }: &mut FrameWriter<W, N> = self;
        while !outbox.is_empty() {
            match port.write(outbox.unsent())$($await)*.map_err(WriteError::Port)? {
                0 => return Err(WriteError::Zero),
                count => outbox.taken(count),
            }
        }
        Ok(())
    }
}
};
}

calls!(FrameReader, embedded_io::Read, FrameWriter, embedded_io::Write, [], []);

#[cfg(feature = "embedded-io-async")]
use super::asynch::{FrameReader as AsyncReader, FrameWriter as AsyncWriter};
#[cfg(feature = "embedded-io-async")]
calls!(AsyncReader, embedded_io_async::Read, AsyncWriter, embedded_io_async::Write, [async], [.await]);
