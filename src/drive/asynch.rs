//! The same calls for `embedded-io-async`.

use core::{
    future::{Future, poll_fn, ready},
    pin::pin,
    task::Poll,
};

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

use super::{
    clock::Clock,
    driver::{CHUNK_LEN, Driver, FRAMES, Needs, READS},
    error::DriveError,
    sending::FRAME_LEN,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant},
};

/// Longest time in which a port may take no byte, or not be flushed.
const STALL: Duration = Duration::from_millis(1000);

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
    /// [`DriveError::Port`], [`Closed`](DriveError::Closed), [`WriteZero`](DriveError::WriteZero) or
    /// [`Stalled`](DriveError::Stalled), the first of several; but a [`Rs485`](super::Rs485)
    /// port that cannot be flushed behind a `write` that failed is `Stalled`. What is due has been
    /// sent and flushed all the same, as far as the port could. A call that fails has yielded once,
    /// so that a loop that ignores errors does not starve the other tasks.
    pub async fn service_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let result = self.round_async().await;
        if result.is_err() {
            yield_once().await;
        }
        result
    }

    async fn round_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.reclaim();
        let mut result = Ok(());
        for _ in 0..FRAMES {
            result = result.and(self.receive_async().await);
            self.expire();
            match self.load() {
                Ok(false) => break,
                Ok(true) => {}
                Err(error) => {
                    result = result.and(Err(error));
                    break;
                }
            }
            let sent = self.send_async().await;
            let has_failed = sent.is_err();
            result = result.and(sent);
            if has_failed {
                break;
            }
        }
        if self.sending.needs_flush() {
            let flushed = self.flush_async().await;
            result = result.and(flushed);
        }
        result
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

    /// Goes on until `deadline`. Every event is handed to `on_event`, with the role, to be commanded, and
    /// the time.
    ///
    /// # Errors
    ///
    /// As [`service_async`](Self::service_async).
    pub async fn run_until_async(
        &mut self,
        deadline: Instant,
        mut on_event: impl FnMut(&mut R, R::Event, Instant),
    ) -> Result<(), DriveError<P::Error>> {
        while let Some(event) = self.next_event_async(deadline).await? {
            let now = self.now();
            on_event(&mut self.role, event, now);
            if now >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Goes on until `done` says so; `None` at `deadline`. A port that fails ends it.
    pub(super) async fn until_async<T>(
        &mut self,
        deadline: Instant,
        done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.until_with_async(deadline, Needs::WholePort, done).await
    }

    /// The same; says whether `done` is asked after a failure as well.
    pub(super) async fn until_with_async<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        loop {
            let result = self.service_async().await;
            if result.is_ok() || needs != Needs::WholePort {
                if let Some(found) = done(self) {
                    return Ok(Some(found));
                }
            }
            result?;
            if self.now() >= deadline {
                return Ok(None);
            }
            self.wait_async(deadline).await?;
        }
    }

    /// Takes in what is there: each read is asked once, and not waited for.
    async fn receive_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        self.look();
        for _ in 0..READS {
            match first(self.port.read(&mut chunk), ready(())).await {
                Some(count) => {
                    self.receive_chunk(&chunk, count.map_err(DriveError::Port)?)?;
                }
                None => {
                    self.saw_empty();
                    break;
                }
            }
        }
        Ok(())
    }

    async fn send_async(&mut self) -> Result<(), DriveError<P::Error>> {
        while !self.sending.rest().is_empty() {
            self.before_write();
            let now = self.now();
            let waited = self.sending.write_wait.begin(now);
            let patience_us = self.patience_us(waited);
            let writing = self.port.write(self.sending.rest());
            let written = first(writing, self.clock.delay_us(patience_us)).await;
            self.sending.write_wait.end();
            let Some(written) = written else {
                self.reclaim();
                return self.stalled_async().await;
            };
            self.after_write(written)?;
        }
        if self.sending.is_in_doubt() {
            self.flush_async().await?;
        }
        Ok(())
    }

    async fn flush_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let now = self.now();
        let waited = self.sending.flush_wait.begin(now);
        let patience_us = self.patience_us(waited);
        let flushed = first(self.port.flush(), self.clock.delay_us(patience_us)).await;
        self.sending.flush_wait.end();
        match flushed {
            Some(flushed) => self.after_flush(flushed),
            None => self.stalled_async().await,
        }
    }

    /// For how long to wait for the port, microseconds: what is left of a second since it was asked
    /// first, perhaps in a call that was dropped. A port that is well, and was not asked for a while,
    /// has the time that a frame takes in any case.
    fn patience_us(&self, waited: Duration) -> u32 {
        let frame_us = 2 * self.role.wire_time(FRAME_LEN).as_micros() + 1000;
        STALL.as_micros().saturating_sub(waited.as_micros()).max(frame_us)
    }

    /// The port has stalled. A write of no bytes, which takes no time, lets a
    /// [`Rs485`](super::Rs485) port put its pin off, with bytes still in it, perhaps.
    async fn stalled_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.unflushed();
        let _ = first(self.port.write(&[]), ready(())).await;
        Err(DriveError::Stalled)
    }

    /// Waits for bytes, for the role's next deadline or for `deadline`, whichever is first.
    async fn wait_async(&mut self, deadline: Instant) -> Result<(), DriveError<P::Error>> {
        let wake_at = self.wake_at(deadline);
        let nap = (wake_at - self.now()).as_micros().min(NAP_US);
        let mut chunk = [0; CHUNK_LEN];
        match first(self.port.read(&mut chunk), self.clock.delay_us(nap)).await {
            Some(count) => {
                let result = count.map_err(DriveError::Port);
                let result = result.and_then(|count| self.receive_chunk(&chunk, count));
                if result.is_err() {
                    yield_once().await;
                }
                result
            }
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

/// Lets other tasks run.
async fn yield_once() {
    let mut has_yielded = false;
    poll_fn(|context| {
        if core::mem::replace(&mut has_yielded, true) {
            return Poll::Ready(());
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}
