//! The [`Driver`] of async code, over the traits of `embedded-io-async`.
//!
//! It has the calls of the [blocking one](super::Driver), under the same names, and what that one
//! has for both worlds: its role, its events, its port. It waits with `DelayNs` of
//! `embedded-hal-async`, which the clock must implement as well:
//! [`WithDelay`](super::WithDelay) combines a clock and a delay.
//!
//! # Cancelling
//!
//! You can drop a call at any await. Received bytes are in the role, bytes to send are in the role
//! or in the driver, and the next call continues:
//!
//! * a set-point or a command is sent once its call has been polled, and a stop is still owed;
//! * a dropped `drive_for` leaves a stop that the next call sends. **If there is no next call, a
//!   motor on a bus runs on, and a robot drives until its watchdog stops it**; that of a vendor
//!   robot waits for silence on the line;
//! * a `drive_for` that is leaked (`mem::forget`) instead of dropped leaves no stop;
//! * a calibration continues, and reports its end as an event;
//! * call a discovery or a read again.
//!
//! The port must do its part: a `read` or `write` that is dropped before it is ready must not have
//! moved any bytes. Each round drops one `read`, and a `write` that waits is dropped and repeated:
//! what is received meanwhile may forbid it. Buffered ports, such as embassy's `BufferedUart`,
//! comply; ports that lend the caller's buffer to a DMA channel for one call do not.
//!
//! # With embassy
//!
//! ```text
//! use axlewire::drive::{WithDelay, asynch::Driver};
//!
//! let uart = BufferedUart::new(..);
//! let clock = || Instant::from_micros(embassy_time::Instant::now().as_micros());
//! let time = WithDelay { clock, delay: embassy_time::Delay };
//! let mut bus = Driver::master(MasterConfig::direct(), uart, time);
//! let nodes = bus.discover().await?;
//! loop {
//!     match select(bus.next_event(Duration::from_millis(100)), COMMANDS.receive()).await {
//!         Either::First(event) => show(event?),
//!         Either::Second((node, target)) => bus.set_velocity(node, target).await?,
//!     }
//! }
//! ```

use core::{
    future::{Future, poll_fn, ready},
    mem,
    ops::{Deref, DerefMut},
    pin::pin,
    task::Poll,
};

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

use super::{
    clock::Clock,
    driver::{self, CHUNK_LEN, ERROR_NAP, FRAMES, Needs, Next, READS, STALL},
    error::DriveError,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant, earliest, reached},
};

/// Shortest pause before a frame that waits for its port is decided again, microseconds; the only
/// one for an answer, which has little time.
const LOOK_US: u32 = 1000;

/// Longest single delay, microseconds, so that the errors of a delay do not add up.
const NAP_US: u32 = 1_000_000;

/// A role with its port and its clock, for async code.
///
/// ```
/// # #[cfg(feature = "ikeya")]
/// # async fn turn<P, C>(port: P, time: C) -> Result<(), axlewire::drive::DriveError<P::Error>>
/// # where
/// #     P: embedded_io_async::Read + embedded_io_async::Write,
/// #     C: axlewire::drive::Clock + embedded_hal_async::delay::DelayNs,
/// # {
/// use axlewire::drive::asynch::Driver;
/// use axlewire::ikeya::{NodeId, Rps, master::MasterConfig};
/// use axlewire::time::Duration;
///
/// let mut bus = Driver::master(MasterConfig::direct(), port, time);
/// println!("{} nodes", bus.discover().await?.len());
/// bus.set_velocity(NodeId::N2, Rps::new(1.5)?).await?;
/// bus.run_for(Duration::from_secs(2), |_master, event, _now| println!("{event:?}")).await?;
/// bus.stop(NodeId::N2).await?; // `Ok` only once the motor is seen to be still
/// # Ok(())
/// # }
/// ```
///
/// A host is driven in the same way, and its reports can be read meanwhile:
///
/// ```
/// # #[cfg(feature = "ucp")]
/// # async fn tour<P, C>(port: P, time: C) -> Result<(), axlewire::drive::DriveError<P::Error>>
/// # where
/// #     P: embedded_io_async::Read + embedded_io_async::Write,
/// #     C: axlewire::drive::Clock + embedded_hal_async::delay::DelayNs,
/// # {
/// use axlewire::drive::asynch::Driver;
/// use axlewire::{time::Duration, ucp::host::{COAST, HostConfig}};
///
/// let mut rover = Driver::host(HostConfig::direct(), port, time);
/// let end = rover.now() + Duration::from_secs(2);
/// let driven = async {
///     while rover.now() < end {
///         rover.drive(30, 0).await?; // percent; counts for half a second
///         if let Some(report) = rover.next_report(Duration::from_millis(100)).await? {
///             println!("{:?} rpm", report.telemetry.rpm);
///         }
///     }
///     Ok(())
/// }
/// .await;
/// rover.stop().await?; // whatever has failed
/// rover.await_standstill(COAST).await?;
/// driven
/// # }
/// ```
///
/// What it has from [`Deref`] serves both worlds, but calls that it has itself, such as `service`
/// and `next_event`, are the blocking ones there: they need a blocking port.
///
/// No call of it loses received bytes, sends an old command late, or waits longer than it says, and
/// after any error the next call continues; each can be dropped at any await. See the
/// [module](self).
#[derive(Clone, Debug)]
pub struct Driver<R, P, C> {
    pub(super) inner: driver::Driver<R, P, C>,
    /// The latest wait for a slow port began with a look at what has been received.
    has_told: bool,
}

/// Why bytes have not been written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unwritten {
    /// The port has not taken them, or they have become wrong.
    Waited,
    /// The executor was held up while they waited, or their frame paused for too long: the role
    /// decides again.
    Late,
}

impl<R: Endpoint, P, C: Clock> Driver<R, P, C> {
    /// Combines a role, a port and a clock, as [`drive::Driver::new`](super::Driver::new) does.
    pub fn new(role: R, port: P, clock: C) -> Self {
        driver::Driver::new(role, port, clock).into()
    }

    /// The same, with a role made here, at the time of this clock.
    pub fn with(role: impl FnOnce(Instant) -> R, port: P, clock: C) -> Self {
        driver::Driver::with(role, port, clock).into()
    }

    /// Role, port and clock, as [`drive::Driver::into_parts`](super::Driver::into_parts) returns
    /// them.
    #[must_use]
    pub fn into_parts(self) -> (R, P, C) {
        self.inner.into_parts()
    }
}

impl<R, P, C> From<driver::Driver<R, P, C>> for Driver<R, P, C> {
    fn from(inner: driver::Driver<R, P, C>) -> Self {
        Self { inner, has_told: false }
    }
}

impl<R, P, C> Deref for Driver<R, P, C> {
    type Target = driver::Driver<R, P, C>;

    fn deref(&self) -> &Self::Target {
        &self.inner
    }
}

impl<R, P, C> DerefMut for Driver<R, P, C> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.inner
    }
}

impl<R: Endpoint, P: Read + Write, C: Clock + DelayNs> Driver<R, P, C> {
    /// Runs one round: takes in received bytes, lets time pass, sends what is due. Waits for
    /// nothing but the port's own `write` and `flush`.
    ///
    /// Its work is bounded: 8 frames sent, and 64 reads of up to 64 bytes at a time.
    ///
    /// # Errors
    ///
    /// The first of any [`DriveError::Port`], [`Closed`](DriveError::Closed),
    /// [`WriteZero`](DriveError::WriteZero) or [`Stalled`](DriveError::Stalled); but if an
    /// [`Rs485`](super::Rs485) port cannot be flushed after a failed `write`, the error is
    /// `Stalled`. What is due has still been sent and flushed, as far as the port could. A failed
    /// call has yielded once, so a loop that ignores errors does not starve other tasks.
    pub async fn service(&mut self) -> Result<(), DriveError<P::Error>> {
        // A call that was leaked has not cleared it.
        self.ends_at = None;
        self.fair_round().await
    }

    /// One round that lets other tasks run if it fails.
    async fn fair_round(&mut self) -> Result<(), DriveError<P::Error>> {
        let result = self.round().await;
        // A runaway port, which always has more, must not starve other tasks either.
        if result.is_err() || self.looks.unsure_since.is_some() {
            yield_once().await;
        }
        result
    }

    async fn round(&mut self) -> Result<(), DriveError<P::Error>> {
        let (mut result, begin) = (Ok(()), self.now());
        self.reclaim(begin);
        if begin - self.looks.latest >= STALL {
            // It may have recovered meanwhile.
            self.sending.end_waits();
        }
        let mut again = 0;
        for _ in 0..FRAMES {
            result = result.and(self.receive().await);
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
            let (received, sent) = self.send(begin).await;
            let has_failed = sent.is_err();
            result = result.and(received).and(sent);
            if !has_failed && self.sending.is_in_doubt() {
                let flushed = self.flush().await;
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
            let flushed = self.flush().await;
            result = result.and(flushed);
        }
        result
    }

    /// Runs until `done` returns a value; `None` at `deadline`. `needs` tells whether a failing
    /// port ends it, or `done` is called then as well.
    pub(super) async fn until_with<T>(
        &mut self,
        deadline: Instant,
        needs: Needs,
        mut done: impl FnMut(&mut driver::Driver<R, P, C>) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.ends_at = needs.ends_at(deadline);
        loop {
            let mut result = Ok(());
            // Through a slow port, each call may be dropped before its round ends: what came in is
            // told before that, but not twice in a row, so that the port is asked again.
            self.has_told = !self.has_told && self.round_time().is_some() && self.is_pending();
            if self.has_told {
                result = self.receive().await;
                self.expire();
                if result.is_ok() || needs.is_half() {
                    if let Some(found) = done(self) {
                        return Ok(Some(found));
                    }
                }
            }
            result = result.and(self.fair_round().await);
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
                self.wait(deadline).await?;
            }
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
    pub(super) async fn nap(&mut self, deadline: Instant) {
        let pause = (deadline - self.now()).min(ERROR_NAP);
        self.inner.clock.delay_us(pause.as_micros()).await;
    }

    /// Takes in received bytes: polls each read once, without waiting.
    pub(super) async fn receive(&mut self) -> Result<(), DriveError<P::Error>> {
        let mut chunk = [0; CHUNK_LEN];
        let now = self.latest();
        self.looks.begin(now);
        for _ in 0..READS {
            match first(self.port.read(&mut chunk), ready(())).await {
                Some(count) => {
                    self.receive_chunk(&chunk, count.map_err(DriveError::Port)?)?;
                }
                None => {
                    let now = self.latest();
                    self.looks.saw_empty(now);
                    break;
                }
            }
        }
        Ok(())
    }

    /// Sends the unsent bytes. Between two parts of a frame it takes in what has been received:
    /// that may forbid the rest. A failing receiver does not stop the sending.
    async fn send(&mut self, begin: Instant) -> (Received<P::Error>, Sent<P::Error>) {
        let mut received = Ok(());
        let mut asked = None;
        while !self.sending.rest().is_empty() {
            if !self.before_write() {
                return (received, Ok(()));
            }
            let now = self.latest();
            let (since, waited) =
                *asked.get_or_insert_with(|| (now, self.sending.write_wait.begin(now)));
            let (wait_us, is_last) = self.patience(waited);
            let left_us = wait_us.saturating_sub((now - since).as_micros());
            let look_us = self.port_time(self.sending.rest().len()).as_micros();
            // The last wait is no shorter than a look: a healthy port needs some time.
            let is_look = left_us >= look_us.saturating_mul(2);
            let wait_us = if is_look { look_us } else { left_us };
            let written = match self.write_rest(wait_us, since).await {
                Ok(written) => written,
                Err(_) if self.role.is_outdated() => {
                    // The role decides again, within the time that this frame had.
                    let now = self.latest();
                    self.give_up(now);
                    return (received, Ok(()));
                }
                Err(why) if why == Unwritten::Late && waited < STALL || self.is_over() => {
                    let now = self.latest();
                    self.reclaim(now);
                    return (received, Ok(()));
                }
                // What is received meanwhile may forbid it.
                Err(Unwritten::Waited) if is_look => {
                    received = received.and(self.receive().await);
                    continue;
                }
                Err(_) if !is_last => return (received, Ok(())),
                Err(_) => {
                    self.sending.write_wait.end();
                    let now = self.now();
                    self.reclaim(now);
                    return (received, self.stalled().await);
                }
            };
            self.sending.write_wait.end();
            asked = None;
            if let Err(error) = self.after_write(written) {
                return (received, Err(error));
            }
            if !self.sending.rest().is_empty() {
                received = received.and(self.receive().await);
                if self.is_held_up(begin) {
                    return (received, Ok(()));
                }
            }
        }
        (received, Ok(()))
    }

    /// Asks the port to take the unsent bytes; an error if it does not within this time, or if they
    /// have become wrong meanwhile: then none of them has left.
    async fn write_rest(
        &mut self,
        wait_us: u32,
        first_asked_at: Instant,
    ) -> Result<Result<usize, P::Error>, Unwritten> {
        let patience_us = self.patience_between_steps().as_micros();
        let acts = driver::look_period(&self.role).is_some();
        // A host says itself what is outdated by now: its stops are not, however late they are.
        let knows_time = self.role.line_rules().held_up_after == Some(Duration::ZERO);
        let whole_by = self.sending.whole_by(self.silence());
        let driver::Driver { role, port, clock, time, sending, ends_at, .. } = &mut self.inner;
        let mut writing = pin!(port.write(sending.rest()));
        let (begin, mut now) = (time.latest(), time.latest());
        loop {
            // The clock has been read just before: the port does not take what has ended.
            if let Some(written) = first(writing.as_mut(), ready(())).await {
                return Ok(written);
            }
            let left_us = wait_us.saturating_sub((now - begin).as_micros());
            if left_us == 0 {
                return Err(Unwritten::Waited);
            }
            let decides_at = earliest(&[role.poll_timeout(), *ends_at, whole_by]);
            let nap_us = decides_at.map_or(left_us, |at| (at - now).as_micros());
            let nap_us = if acts { LOOK_US } else { nap_us.max(LOOK_US) }.min(left_us);
            wake(clock.delay_us(nap_us)).await;
            let asked_at = mem::replace(&mut now, time.read(clock));
            role.handle_input(&[], now);
            if role.is_outdated() || reached(*ends_at, now) {
                return Err(Unwritten::Waited);
            }
            if whole_by.is_some_and(|by| now > by) {
                return Err(Unwritten::Late);
            }
            // An answer of a slave or a robot has no more time than that altogether.
            let (since, nap_us) = if acts { (first_asked_at, 0) } else { (asked_at, nap_us) };
            if !knows_time && (now - since).as_micros() > nap_us.saturating_add(patience_us) {
                return Err(Unwritten::Late);
            }
        }
    }

    async fn flush(&mut self) -> Result<(), DriveError<P::Error>> {
        let now = self.now();
        let waited = self.sending.flush_wait.begin(now);
        let (wait_us, is_last) = self.patience(waited);
        let driver::Driver { port, clock, .. } = &mut self.inner;
        let flushed = first(port.flush(), clock.delay_us(wait_us)).await;
        if flushed.is_none() && !is_last {
            return Ok(());
        }
        self.sending.flush_wait.end();
        match flushed {
            Some(flushed) => self.after_flush(flushed),
            None => self.stalled().await,
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
    async fn stalled(&mut self) -> Result<(), DriveError<P::Error>> {
        self.unflushed();
        let _ = first(self.port.write(&[]), ready(())).await;
        Err(DriveError::Stalled)
    }

    /// Waits for bytes, for the role's next deadline or for `deadline`, whichever comes first.
    async fn wait(&mut self, deadline: Instant) -> Result<(), DriveError<P::Error>> {
        let wake_at = self.wake_at(deadline);
        let nap = (wake_at - self.now()).as_micros().min(NAP_US);
        let mut chunk = [0; CHUNK_LEN];
        let driver::Driver { port, clock, .. } = &mut self.inner;
        match first(port.read(&mut chunk), clock.delay_us(nap)).await {
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

/// Ends with `delay`, or when the task is woken before, by a port for example.
async fn wake(delay: impl Future<Output = ()>) {
    let mut delay = pin!(delay);
    let mut is_woken = false;
    poll_fn(|context| match mem::replace(&mut is_woken, true) {
        true => Poll::Ready(()),
        false => delay.as_mut().poll(context),
    })
    .await;
}

/// Lets other tasks run.
async fn yield_once() {
    let mut has_yielded = false;
    poll_fn(|context| {
        if mem::replace(&mut has_yielded, true) {
            return Poll::Ready(());
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}
