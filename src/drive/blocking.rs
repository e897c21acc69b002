//! The blocking rounds, over `embedded-io`.

use embedded_io::{Read, ReadReady, Write};

use super::{
    clock::Clock,
    driver::{CHUNK_LEN, Driver, ERROR_NAP, FRAMES, Needs, Next, READS},
    error::DriveError,
};
use crate::{endpoint::Endpoint, time::Instant};

impl<R: Endpoint, P: Read + Write + ReadReady, C: Clock> Driver<R, P, C> {
    /// Runs one round: takes in received bytes, lets time pass, sends what is due. Waits for
    /// nothing but the port's own `write` and `flush`.
    ///
    /// Its work is bounded: 8 frames sent, and 64 reads of up to 64 bytes at a time. Call it
    /// repeatedly from a main loop, no later than [`poll_timeout`](Self::poll_timeout).
    ///
    /// # Errors
    ///
    /// The first of any [`DriveError::Port`], [`Closed`](DriveError::Closed) or
    /// [`WriteZero`](DriveError::WriteZero). What is due has still been sent and flushed, as far as
    /// the port could.
    pub fn service(&mut self) -> Result<(), DriveError<P::Error>> {
        // A call of an async driver that was leaked has not cleared it.
        self.ends_at = None;
        self.round()
    }

    fn round(&mut self) -> Result<(), DriveError<P::Error>> {
        let (mut result, begin) = (Ok(()), self.now());
        self.reclaim(begin);
        let mut again = 0;
        for _ in 0..FRAMES {
            // Before time passes: the rest of a frame may wait in the port.
            result = result.and(self.receive());
            self.expire();
            match self.load(again) {
                Ok(Next::End) => break,
                Ok(Next::Look) => {
                    again += 1;
                    continue;
                }
                Ok(Next::Send) => again = 0,
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

    /// Runs until `done` returns a value; `None` at `deadline`. `needs` tells whether a failing
    /// port ends it, or `done` is called then as well.
    pub(super) fn until_with<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.ends_at = needs.ends_at(deadline);
        loop {
            let result = self.round();
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

    /// Pauses before a port that has failed is asked again, until this deadline at the latest.
    #[cfg_attr(
        not(any(feature = "ikeya", feature = "ucp")),
        allow(dead_code, reason = "only the calls of a role use it")
    )]
    pub(super) fn nap(&mut self, deadline: Instant) {
        let until = self.on_clock((self.now() + ERROR_NAP).min(deadline));
        self.clock.idle_until(until);
    }

    /// Takes in received bytes.
    pub(super) fn receive(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        self.looks.begin(self.time.latest());
        for _ in 0..READS {
            if !self.port.read_ready().map_err(DriveError::Port)? {
                self.looks.saw_empty(self.time.latest());
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
            if !self.before_write() {
                return (received, Ok(()));
            }
            let written = self.port.write(self.sending.rest());
            if let Err(error) = self.after_write(written) {
                return (received, Err(error));
            }
            if !self.sending.rest().is_empty() {
                received = received.and(self.receive());
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
