//! The async calls, over `embedded-io-async`.

use core::{
    future::{Future, poll_fn, ready},
    pin::pin,
    task::Poll,
};

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

use super::{
    clock::Clock,
    driver::{CHUNK_LEN, Driver, FRAMES, Needs, READS, STALL},
    error::DriveError,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant, earliest, reached},
};

/// Shortest pause before a frame that waits for its port is looked at again, microseconds.
const LOOK_US: u32 = 1000;

/// Longest single delay, microseconds, so that the errors of a delay do not add up.
const NAP_US: u32 = 1_000_000;

impl<R: Endpoint, P: Read + Write, C: Clock + DelayNs> Driver<R, P, C> {
    /// Runs one round: takes in received bytes, lets time pass, sends what is due. Waits for
    /// nothing but the port's own `write` and `flush`.
    ///
    /// Its work is bounded: 8 frames sent, and 4096 bytes taken in at a time.
    ///
    /// # Errors
    ///
    /// The first of any [`DriveError::Port`], [`Closed`](DriveError::Closed),
    /// [`WriteZero`](DriveError::WriteZero) or [`Stalled`](DriveError::Stalled); but if an
    /// [`Rs485`](super::Rs485) port cannot be flushed after a failed `write`, the error is
    /// `Stalled`. What is due has still been sent and flushed, as far as the port could. A failed
    /// call has yielded once, so a loop that ignores errors does not starve other tasks.
    pub async fn service_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let result = self.round_async().await;
        // A runaway port, which always has more, must not starve other tasks either.
        if result.is_err() || self.unsure_since.is_some() {
            yield_once().await;
        }
        result
    }

    async fn round_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.reclaim();
        let (mut result, begin) = (Ok(()), self.now());
        if begin - self.looked_at >= STALL {
            // It may have recovered meanwhile.
            self.sending.end_waits();
        }
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
            let (received, sent) = self.send_async(begin).await;
            let has_failed = sent.is_err();
            result = result.and(received).and(sent);
            if !has_failed && self.sending.is_in_doubt() {
                let flushed = self.flush_async().await;
                if flushed.is_err() {
                    // The next round tries it again.
                    return result.and(flushed);
                }
            }
            if !has_failed && self.sending.is_pending() {
                // The next round continues to wait for the port.
                return result;
            }
            if has_failed || self.is_held_up(begin) || self.is_over() {
                break;
            }
        }
        if self.sending.needs_flush() {
            let flushed = self.flush_async().await;
            result = result.and(flushed);
        }
        result
    }

    /// Returns the next event; waits for it for this long, then returns `None`. Runs at least one
    /// round, even with [`Duration::ZERO`].
    ///
    /// # Errors
    ///
    /// Same as [`service_async`](Self::service_async). Events from before the failure are not lost.
    pub async fn next_event_async(
        &mut self,
        within: Duration,
    ) -> Result<Option<R::Event>, DriveError<P::Error>> {
        self.until_async(self.now() + within, Self::poll_event).await
    }

    /// Runs for `span`, and passes every event to `on_event`, with the role, to give it commands,
    /// and the time. A command that is given at the end, a stop too, leaves with the next call.
    ///
    /// # Errors
    ///
    /// Same as [`service_async`](Self::service_async).
    pub async fn run_for_async(
        &mut self,
        span: Duration,
        mut on_event: impl FnMut(&mut R, R::Event, Instant),
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + span;
        while let Some(event) = self.until_async(deadline, Self::poll_event).await? {
            let now = self.now();
            on_event(&mut self.role, event, now);
            if now >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Runs until `done` returns a value; `None` at `deadline`. A failing port ends it.
    pub(super) async fn until_async<T>(
        &mut self,
        deadline: Instant,
        done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.until_with_async(deadline, Needs::WholePort, done).await
    }

    /// The same; `needs` tells whether to call `done` after a failure as well.
    pub(super) async fn until_with_async<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.ends_at = needs.ends_at(deadline);
        loop {
            let mut result = Ok(());
            // Through a slow port, each call may be dropped before its round ends: what came in is
            // told before that, but not twice in a row, so that the port is asked again.
            self.has_told = !self.has_told && self.round_time().is_some() && self.is_pending();
            if self.has_told {
                result = self.receive_async().await;
                self.expire();
                if result.is_ok() || needs.is_half() {
                    if let Some(found) = done(self) {
                        return Ok(Some(found));
                    }
                }
            }
            result = result.and(self.service_async().await);
            if result.is_ok() || needs.is_half() {
                if let Some(found) = done(self) {
                    return Ok(Some(found));
                }
            }
            result?;
            if self.now() >= deadline {
                return Ok(None);
            }
            // A port that is slow is waited for first: its driver may be on.
            if self.is_sent() {
                self.wait_async(deadline).await?;
            }
            if self.is_over() {
                return Ok(None);
            }
        }
    }

    /// Takes in received bytes: polls each read once, without waiting.
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

    /// Sends the unsent bytes. Between two parts of a frame it takes in what has been received:
    /// that may forbid the rest. A failing receiver does not stop the sending.
    async fn send_async(&mut self, begin: Instant) -> (Received<P::Error>, Sent<P::Error>) {
        let mut received = Ok(());
        while !self.sending.rest().is_empty() {
            self.before_write();
            let now = self.now();
            let waited = self.sending.write_wait.begin(now);
            let (wait_us, is_last) = self.patience(waited);
            let written = self.write_async(wait_us).await;
            if written.is_none() && self.role.is_outdated() {
                // The role decides again, within the time that this frame had.
                self.give_up_outdated();
                continue;
            }
            if written.is_none() && self.is_over() {
                self.reclaim();
                return (received, Ok(()));
            }
            if written.is_none() && !is_last {
                return (received, Ok(()));
            }
            self.sending.write_wait.end();
            let Some(written) = written else {
                self.reclaim();
                return (received, self.stalled_async().await);
            };
            if let Err(error) = self.after_write(written) {
                return (received, Err(error));
            }
            if !self.sending.rest().is_empty() {
                received = received.and(self.receive_async().await);
                self.give_up_outdated();
                if self.is_held_up(begin) {
                    return (received, Ok(()));
                }
            }
        }
        (received, Ok(()))
    }

    /// Asks the port to take the unsent bytes; `None` if it does not within this time, or if they
    /// have become wrong meanwhile: then none of them has left.
    async fn write_async(&mut self, wait_us: u32) -> Option<Result<usize, P::Error>> {
        let Self { role, port, clock, time, sending, ends_at, .. } = self;
        let mut writing = pin!(port.write(sending.rest()));
        let (begin, mut now, mut written) = (time.latest(), time.latest(), None);
        loop {
            let left_us = wait_us.saturating_sub((now - begin).as_micros());
            if left_us == 0 {
                return first(writing, ready(())).await;
            }
            let decides_at = earliest(&[role.poll_timeout(), *ends_at]);
            let nap_us = decides_at.map_or(left_us, |at| (at - now).as_micros());
            let nap_us = nap_us.max(LOOK_US).min(left_us);
            // The delay first: if this task was held up, the port does not take what has ended.
            let taking = until(writing.as_mut(), &mut written);
            if first(clock.delay_us(nap_us), taking).await.is_none() {
                return written;
            }
            now = time.read(clock);
            role.handle_input(&[], now);
            if role.is_outdated() || reached(*ends_at, now) {
                return None;
            }
        }
    }

    async fn flush_async(&mut self) -> Result<(), DriveError<P::Error>> {
        let now = self.now();
        let waited = self.sending.flush_wait.begin(now);
        let (wait_us, is_last) = self.patience(waited);
        let flushed = first(self.port.flush(), self.clock.delay_us(wait_us)).await;
        if flushed.is_none() && !is_last {
            return Ok(());
        }
        self.sending.flush_wait.end();
        match flushed {
            Some(flushed) => self.after_flush(flushed),
            None => self.stalled_async().await,
        }
    }

    /// Time to wait for the port in this call, microseconds, after `waited` since it was first
    /// asked; and whether it has stalled if it is not done then.
    ///
    /// It has stalled after a second, but never before the time that a frame takes: a healthy port
    /// may not have been asked for a while. A slave or a robot waits for less, so that its
    /// application can hear of a watchdog, but as long as a healthy port needs to finish.
    fn patience(&self, waited: Duration) -> (u32, bool) {
        let left_us = STALL.as_micros().saturating_sub(waited.as_micros());
        let left = Duration::from_micros(left_us).max(self.frame_time());
        let wait = self.round_time().map_or(left, |limit| limit.min(left));
        (wait.as_micros(), wait == left)
    }

    /// Handles a stalled port. A write of no bytes, which takes no time, lets an
    /// [`Rs485`](super::Rs485) port switch its pin off, perhaps with bytes still in it.
    async fn stalled_async(&mut self) -> Result<(), DriveError<P::Error>> {
        self.unflushed();
        let _ = first(self.port.write(&[]), ready(())).await;
        Err(DriveError::Stalled)
    }

    /// Waits for bytes, for the role's next deadline or for `deadline`, whichever comes first.
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

type Received<E> = Result<(), DriveError<E>>;
type Sent<E> = Result<(), DriveError<E>>;

/// The result of `read`; `None` if `wait` is over first. If both are ready, `read` wins.
async fn first<T>(read: impl Future<Output = T>, wait: impl Future<Output = ()>) -> Option<T> {
    let (mut read, mut wait) = (pin!(read), pin!(wait));
    poll_fn(|context| match read.as_mut().poll(context) {
        Poll::Ready(found) => Poll::Ready(Some(found)),
        Poll::Pending => wait.as_mut().poll(context).map(|()| None),
    })
    .await
}

/// Ends with `future`, and keeps its output.
async fn until<T>(future: impl Future<Output = T>, output: &mut Option<T>) {
    *output = Some(future.await);
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
