//! The time source of a driver.

use core::cell::Cell;

use crate::time::Instant;

/// A microsecond clock that does not go backwards.
///
/// With it a driver sees pauses inside of what it sends, and answers that come too early: it must
/// count in steps of at most 20 µs on a motor bus, of a millisecond with a rover.
///
/// A closure is a clock: `|| Instant::from_micros(counter())`. For a 32-bit counter, use
/// [`Wrapping32`](crate::time::Wrapping32).
pub trait Clock {
    /// The current time.
    fn now(&self) -> Instant;

    /// Idles until `until`, or for a part of that time: the caller checks for received bytes when
    /// this returns. Return in time: if the driver of a slave or a robot is late, the bytes that it
    /// finds count as old ([module](super#when-a-driver-is-held-up)). For the driver of a host,
    /// idle for at most 20 ms, or until a byte is received: it takes each report to be as old as
    /// the look before.
    ///
    /// Only the blocking calls use it. By default it returns at once, so that they spin: right for
    /// a processor with nothing else to do.
    fn idle_until(&mut self, until: Instant) {
        let _ = until;
        core::hint::spin_loop();
    }
}

impl<F: Fn() -> Instant> Clock for F {
    fn now(&self) -> Instant {
        self()
    }
}

/// The time given to a role: that of a clock, but if the clock goes backwards, this continues from
/// where it was. One wrong reading must not stop a role.
#[derive(Clone, Debug)]
pub(super) struct SteadyTime {
    latest: Cell<Instant>,
    /// Lead over the clock, microseconds: the sum of all its backward steps.
    ahead_us: Cell<u64>,
}

impl SteadyTime {
    pub(super) const fn new(latest: Instant) -> Self {
        Self { latest: Cell::new(latest), ahead_us: Cell::new(0) }
    }

    /// The time now.
    pub(super) fn read(&self, clock: &impl Clock) -> Instant {
        let reading = clock.now().as_micros();
        let (now, latest) =
            (Instant::from_micros(reading.wrapping_add(self.ahead_us.get())), self.latest());
        if now < latest {
            self.ahead_us.set(latest.as_micros().wrapping_sub(reading));
            return latest;
        }
        self.latest.set(now);
        now
    }

    /// The latest time that was read.
    pub(super) fn latest(&self) -> Instant {
        self.latest.get()
    }

    /// The same moment on the clock.
    pub(super) fn on_clock(&self, at: Instant) -> Instant {
        Instant::from_micros(at.as_micros().wrapping_sub(self.ahead_us.get()))
    }
}

/// The monotonic clock of `std`, starting at 0.
///
/// Idles in naps of 200 µs: short compared with an answer on the line, but long for a processor,
/// which is free for other work most of the time.
#[cfg(feature = "std")]
#[derive(Clone, Copy, Debug)]
pub struct StdClock {
    zero: std::time::Instant,
}

#[cfg(feature = "std")]
impl StdClock {
    /// Longest nap, microseconds.
    const NAP_US: u32 = 200;

    /// A clock that starts at 0.
    #[must_use]
    pub fn new() -> Self {
        Self { zero: std::time::Instant::now() }
    }
}

/// [`new`](StdClock::new).
#[cfg(feature = "std")]
impl Default for StdClock {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(feature = "std")]
impl Clock for StdClock {
    fn now(&self) -> Instant {
        Instant::from_micros(self.zero.elapsed().as_micros() as u64)
    }

    fn idle_until(&mut self, until: Instant) {
        let micros = (until - self.now()).as_micros().min(Self::NAP_US);
        if micros > 0 {
            std::thread::sleep(core::time::Duration::from_micros(micros.into()));
        }
    }
}

/// A clock and a delay in one, for the async calls: `WithDelay { clock, delay }`.
///
/// Both must run at the same rate: a fast delay makes the driver check its clock more often, a slow
/// one makes it late.
#[cfg(feature = "embedded-io-async")]
#[derive(Clone, Copy, Debug, Default)]
pub struct WithDelay<C, D> {
    /// The clock.
    pub clock: C,
    /// The delay.
    pub delay: D,
}

#[cfg(feature = "embedded-io-async")]
impl<C: Clock, D> Clock for WithDelay<C, D> {
    fn now(&self) -> Instant {
        self.clock.now()
    }

    fn idle_until(&mut self, until: Instant) {
        self.clock.idle_until(until);
    }
}

#[cfg(feature = "embedded-io-async")]
impl<C, D: embedded_hal_async::delay::DelayNs> embedded_hal_async::delay::DelayNs
    for WithDelay<C, D>
{
    async fn delay_ns(&mut self, ns: u32) {
        self.delay.delay_ns(ns).await;
    }

    async fn delay_us(&mut self, us: u32) {
        self.delay.delay_us(us).await;
    }

    async fn delay_ms(&mut self, ms: u32) {
        self.delay.delay_ms(ms).await;
    }
}
