//! The blocking calls.

use embedded_io::{Read, ReadReady, Write};

use super::{
    clock::Clock,
    driver::{CHUNK_LEN, Driver, FRAMES, Needs, READS},
    error::DriveError,
};
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
    /// [`DriveError::Port`], [`Closed`](DriveError::Closed) or [`WriteZero`](DriveError::WriteZero),
    /// the first of several. What is due has been sent and flushed all the same, as far as the port
    /// could.
    pub fn service(&mut self) -> Result<(), DriveError<P::Error>> {
        self.reclaim();
        let mut result = self.receive();
        for _ in 0..FRAMES {
            self.expire();
            match self.load() {
                Ok(false) => break,
                Ok(true) => {}
                Err(error) => {
                    result = result.and(Err(error));
                    break;
                }
            }
            let (received, sent) = self.send();
            let has_failed = sent.is_err();
            result = result.and(received).and(sent);
            if has_failed {
                break;
            }
        }
        if self.sending.needs_flush() {
            let flushed = self.port.flush();
            result = result.and(self.after_flush(flushed));
        }
        result
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

    /// Goes on until `deadline`. Every event is handed to `on_event`, with the role, to be commanded, and
    /// the time.
    ///
    /// # Errors
    ///
    /// As [`service`](Self::service).
    pub fn run_until(
        &mut self,
        deadline: Instant,
        mut on_event: impl FnMut(&mut R, R::Event, Instant),
    ) -> Result<(), DriveError<P::Error>> {
        while let Some(event) = self.next_event(deadline)? {
            let now = self.now();
            on_event(&mut self.role, event, now);
            if now >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Goes on until `done` says so; `None` at `deadline`. A port that fails ends it.
    pub(super) fn until<T>(
        &mut self,
        deadline: Instant,
        done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.until_with(deadline, Needs::WholePort, done)
    }

    /// The same; says whether `done` is asked after a failure as well.
    pub(super) fn until_with<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            let result = self.service();
            if result.is_ok() || needs != Needs::WholePort {
                if let Some(found) = done(self) {
                    return Ok(Some(found));
                }
            }
            result?;
            if self.now() >= deadline {
                return Ok(None);
            }
            let until = self.on_clock(self.wake_at(deadline));
            self.clock.idle_until(until);
        }
    }

    /// Takes in what is there.
    fn receive(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        self.look();
        for _ in 0..READS {
            if !self.port.read_ready().map_err(DriveError::Port)? {
                self.saw_empty();
                break;
            }
            let count = self.port.read(&mut chunk).map_err(DriveError::Port)?;
            self.receive_chunk(&chunk, count)?;
        }
        Ok(())
    }

    /// Sends what is unsent, and takes in what has come meanwhile: it belongs in front of the next
    /// frame, and a receiver without a buffer would lose it. A receiver that fails does not end the
    /// sending.
    fn send(&mut self) -> (Received<P::Error>, Sent<P::Error>) {
        let mut received = Ok(());
        while !self.sending.rest().is_empty() {
            self.before_write();
            let written = self.port.write(self.sending.rest());
            if let Err(error) = self.after_write(written) {
                return (received, Err(error));
            }
            received = received.and(self.receive());
        }
        if self.sending.is_in_doubt() {
            let flushed = self.port.flush();
            return (received, self.after_flush(flushed));
        }
        (received, Ok(()))
    }
}

type Received<E> = Result<(), DriveError<E>>;
type Sent<E> = Result<(), DriveError<E>>;
