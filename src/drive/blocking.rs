//! The blocking calls, over `embedded-io`.

use embedded_io::{Read, ReadReady, Write};

use super::{
    clock::Clock,
    driver::{CHUNK_LEN, Driver, FRAMES, Needs, READS},
    error::DriveError,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant},
};

impl<R: Endpoint, P: Read + Write + ReadReady, C: Clock> Driver<R, P, C> {
    /// Runs one round: takes in received bytes, lets time pass, sends what is due. Waits for
    /// nothing but the port's own `write` and `flush`.
    ///
    /// Its work is bounded: 8 frames sent, and 4096 bytes taken in at a time. Call it repeatedly
    /// from a main loop, no later than [`poll_timeout`](Self::poll_timeout).
    ///
    /// # Errors
    ///
    /// The first of any [`DriveError::Port`], [`Closed`](DriveError::Closed) or
    /// [`WriteZero`](DriveError::WriteZero). What is due has still been sent and flushed, as far as
    /// the port could.
    pub fn service(&mut self) -> Result<(), DriveError<P::Error>> {
        self.reclaim();
        let (mut result, begin) = (Ok(()), self.now());
        for _ in 0..FRAMES {
            // Before time passes: the rest of a frame may wait in the port.
            result = result.and(self.receive());
            self.expire();
            match self.load() {
                Ok(false) => break,
                Ok(true) => {}
                Err(error) => {
                    result = result.and(Err(error));
                    break;
                }
            }
            let (received, sent) = self.send(begin);
            let has_failed = sent.is_err();
            result = result.and(received).and(sent);
            if !has_failed && self.sending.is_in_doubt() {
                let flushed = self.flush();
                if flushed.is_err() {
                    // The next round tries it again.
                    return result.and(flushed);
                }
            }
            if has_failed || self.is_held_up(begin) || self.is_over() {
                break;
            }
        }
        if self.sending.needs_flush() {
            result = result.and(self.flush());
        }
        result
    }

    /// Returns the next event; waits for it for this long, then returns `None`. Runs at least one
    /// round, even with [`Duration::ZERO`].
    ///
    /// # Errors
    ///
    /// Same as [`service`](Self::service). Events from before the failure are not lost.
    pub fn next_event(
        &mut self,
        within: Duration,
    ) -> Result<Option<R::Event>, DriveError<P::Error>> {
        self.until(self.now() + within, Self::poll_event)
    }

    /// Runs for `span`, and passes every event to `on_event`, with the role, to give it commands,
    /// and the time. A command that is given at the end, a stop too, leaves with the next call.
    ///
    /// # Errors
    ///
    /// Same as [`service`](Self::service).
    pub fn run_for(
        &mut self,
        span: Duration,
        mut on_event: impl FnMut(&mut R, R::Event, Instant),
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + span;
        while let Some(event) = self.until(deadline, Self::poll_event)? {
            let now = self.now();
            on_event(&mut self.role, event, now);
            if now >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Runs until `done` returns a value; `None` at `deadline`. A failing port ends it.
    pub(super) fn until<T>(
        &mut self,
        deadline: Instant,
        done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.until_with(deadline, Needs::WholePort, done)
    }

    /// The same; `needs` tells whether to call `done` after a failure as well.
    pub(super) fn until_with<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.ends_at = needs.ends_at(deadline);
        loop {
            let result = self.service();
            if result.is_ok() || needs.is_half() {
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
            if self.is_over() {
                return Ok(None);
            }
        }
    }

    /// Takes in received bytes.
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

    /// Sends the unsent bytes. Between two parts of a frame it takes in what has been received:
    /// that may forbid the rest. A failing receiver does not stop the sending.
    fn send(&mut self, begin: Instant) -> (Received<P::Error>, Sent<P::Error>) {
        let mut received = Ok(());
        while !self.sending.rest().is_empty() {
            self.before_write();
            let written = self.port.write(self.sending.rest());
            if let Err(error) = self.after_write(written) {
                return (received, Err(error));
            }
            if !self.sending.rest().is_empty() {
                received = received.and(self.receive());
                self.give_up_outdated();
                if self.is_held_up(begin) {
                    break;
                }
            }
        }
        (received, Ok(()))
    }

    fn flush(&mut self) -> Result<(), DriveError<P::Error>> {
        let flushed = self.port.flush();
        self.after_flush(flushed)
    }
}

type Received<E> = Result<(), DriveError<E>>;
type Sent<E> = Result<(), DriveError<E>>;
