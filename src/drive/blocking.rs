//! The blocking calls.

use embedded_io::{Read, ReadReady, Write};

use super::{CHUNK_LEN, Clock, DriveError, Driver, FRAMES, READS};
use crate::{endpoint::Endpoint, time::Instant};

impl<R: Endpoint, P: Read + Write + ReadReady, C: Clock> Driver<R, P, C> {
    /// One round without waiting for anything but the port's own `write` and `flush`: takes in what
    /// has been received, lets time pass, sends what is due.
    ///
    /// Its work is bounded, by 8 frames sent and 4096 bytes taken in at a time. Call it again and
    /// again from a main loop, at the latest at [`poll_timeout`](Self::poll_timeout).
    ///
    /// # Errors
    ///
    /// [`DriveError::Port`], [`Closed`](DriveError::Closed) or [`WriteZero`](DriveError::WriteZero);
    /// what was received is taken in, what is unsent waits for the next call.
    pub fn service(&mut self) -> Result<(), DriveError<P::Error>> {
        self.receive()?;
        for _ in 0..FRAMES {
            self.expire();
            if !self.load()? {
                break;
            }
            self.send()?;
        }
        if self.unflushed {
            self.port.flush().map_err(DriveError::Port)?;
            self.unflushed = false;
        }
        Ok(())
    }

    /// The next event; waits for it until `deadline`, and is then `None`. At least one round is
    /// made, whatever the time.
    ///
    /// # Errors
    ///
    /// As [`service`](Self::service). Events from before the failure are not lost.
    pub fn next_event(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<R::Event>, DriveError<P::Error>> {
        self.until(deadline, Self::poll_event)
    }

    /// Goes on until `deadline`, with every event handed to `on_event`, which may command the role.
    ///
    /// # Errors
    ///
    /// As [`service`](Self::service).
    pub fn run_until(
        &mut self,
        deadline: Instant,
        mut on_event: impl FnMut(&mut R, R::Event),
    ) -> Result<(), DriveError<P::Error>> {
        while let Some(event) = self.next_event(deadline)? {
            on_event(&mut self.role, event);
            if self.now() >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Goes on until `done` says so; `None` at `deadline`.
    pub(super) fn until<T>(
        &mut self,
        deadline: Instant,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            self.service()?;
            if let Some(found) = done(self) {
                return Ok(Some(found));
            }
            if self.now() >= deadline {
                return Ok(None);
            }
            self.clock.idle_until(self.wake_at(deadline));
        }
    }

    /// Takes in what is there.
    fn receive(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        for _ in 0..READS {
            if !self.port.read_ready().map_err(DriveError::Port)? {
                break;
            }
            let count = self.port.read(&mut chunk).map_err(DriveError::Port)?;
            self.take(&chunk, count)?;
        }
        Ok(())
    }

    /// Sends what is unsent, and takes in what has come meanwhile: it belongs in front of the next
    /// frame, and a receiver without a buffer would lose it.
    fn send(&mut self) -> Result<(), DriveError<P::Error>> {
        while !self.unsent.is_empty() {
            match self.port.write(&self.unsent).map_err(DriveError::Port)? {
                0 => return Err(DriveError::WriteZero),
                count => self.sent(count),
            }
            self.receive()?;
        }
        Ok(())
    }
}
