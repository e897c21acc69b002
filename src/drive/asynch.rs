//! The same calls for `embedded-io-async`.

use core::{
    future::{Future, poll_fn, ready},
    pin::pin,
    task::Poll,
};

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

use super::{CHUNK_LEN, Clock, DriveError, Driver, FRAMES, READS};
use crate::{endpoint::Endpoint, time::Instant};

/// Longest delay asked for at once, microseconds: what a delay is off by does not add up.
const NAP_US: u32 = 1_000_000;

impl<R: Endpoint, P: Read + Write, C: Clock + DelayNs> Driver<R, P, C> {
    /// One round that waits for nothing but the port's own `write` and `flush`: takes in what has
    /// been received, lets time pass, sends what is due.
    ///
    /// Its work is bounded, by 8 frames sent and 4096 bytes taken in at a time.
    ///
    /// # Errors
    ///
    /// [`DriveError::Port`], [`Closed`](DriveError::Closed) or [`WriteZero`](DriveError::WriteZero);
    /// what was received is taken in, what is unsent waits for the next call.
    pub async fn service_async(&mut self) -> Result<(), DriveError<P::Error>> {
        for _ in 0..FRAMES {
            self.receive_async().await?;
            self.expire();
            if !self.load()? {
                break;
            }
            self.send_async().await?;
        }
        if self.unflushed {
            self.port.flush().await.map_err(DriveError::Port)?;
            self.unflushed = false;
        }
        Ok(())
    }

    /// The next event; waits for it until `deadline`, and is then `None`. At least one round is
    /// made, whatever the time.
    ///
    /// # Errors
    ///
    /// As [`service_async`](Self::service_async). Events from before the failure are not lost.
    pub async fn next_event_async(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<R::Event>, DriveError<P::Error>> {
        self.until_async(deadline, Self::poll_event).await
    }

    /// Goes on until `deadline`, with every event handed to `on_event`, which may command the role.
    ///
    /// # Errors
    ///
    /// As [`service_async`](Self::service_async).
    pub async fn run_until_async(
        &mut self,
        deadline: Instant,
        mut on_event: impl FnMut(&mut R, R::Event),
    ) -> Result<(), DriveError<P::Error>> {
        while let Some(event) = self.next_event_async(deadline).await? {
            on_event(&mut self.role, event);
            if self.now() >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Goes on until `done` says so; `None` at `deadline`.
    pub(super) async fn until_async<T>(
        &mut self,
        deadline: Instant,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            self.service_async().await?;
            if let Some(found) = done(self) {
                return Ok(Some(found));
            }
            if self.now() >= deadline {
                return Ok(None);
            }
            self.wait_async(deadline).await?;
        }
    }

    /// Takes in what is there: each read is asked once, and not waited for.
    async fn receive_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        for _ in 0..READS {
            match first(self.port.read(&mut chunk), ready(())).await {
                Some(count) => self.take(&chunk, count.map_err(DriveError::Port)?)?,
                None => break,
            }
        }
        Ok(())
    }

    async fn send_async(&mut self) -> Result<(), DriveError<P::Error>> {
        while !self.unsent.is_empty() {
            match self.port.write(&self.unsent).await.map_err(DriveError::Port)? {
                0 => return Err(DriveError::WriteZero),
                count => self.sent(count),
            }
        }
        Ok(())
    }

    /// Waits for bytes, for the role's next deadline or for `deadline`, whichever is first.
    async fn wait_async(&mut self, deadline: Instant) -> Result<(), DriveError<P::Error>> {
        let nap = (self.wake_at(deadline) - self.now()).as_micros().min(NAP_US);
        let mut chunk = [0; CHUNK_LEN];
        match first(self.port.read(&mut chunk), self.clock.delay_us(nap)).await {
            Some(count) => self.take(&chunk, count.map_err(DriveError::Port)?),
            None => Ok(()),
        }
    }
}

/// What `read` gives; `None` when `wait` is over first. If both are ready, the bytes count.
async fn first<T>(read: impl Future<Output = T>, wait: impl Future<Output = ()>) -> Option<T> {
    let (mut read, mut wait) = (pin!(read), pin!(wait));
    poll_fn(|context| match read.as_mut().poll(context) {
        Poll::Ready(found) => Poll::Ready(Some(found)),
        Poll::Pending => wait.as_mut().poll(context).map(|()| None),
    })
    .await
}
