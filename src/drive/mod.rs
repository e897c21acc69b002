//! Drivers: a role, a port and a clock, put together.
//!
//! A [`Driver`] does the loop that [`Endpoint`] asks for, and nothing else: it moves bytes between a
//! port and a role, tells the role the time, and keeps what a port could not take yet. Who speaks
//! when, what is repeated and what a timeout means is the role's business. It has
//!
//! * blocking calls over the traits of `embedded-io` (feature `embedded-io`). They need `ReadReady`
//!   of the port, and idle by [`Clock::idle_until`];
//! * the same calls with `_async` behind the name over those of `embedded-io-async` (feature
//!   `embedded-io-async`). They wait by `DelayNs` of `embedded-hal-async`, which the clock has to be as
//!   well: [`WithDelay`] makes one of two.
//!
//! For each role there are the calls that a user wants first, such as
//! [`discover`](Driver::discover) and [`read`](Driver::read) of a master, [`drive`](Driver::drive) and
//! [`next_report`](Driver::next_report) of a host. Everything else is done on the
//! [role itself](Driver::role_mut), and takes effect with the next call. A role talks only while
//! one of the driver's calls is running: a master that nobody calls does not repeat its set-points.
//!
//! ```
//! # #[cfg(all(feature = "embedded-io", feature = "ikeya"))] {
//! use axlewire::drive::{Clock, DriveError, Driver};
//! use axlewire::ikeya::{Master, MasterConfig, Mode, Rps};
//! use axlewire::time::Duration;
//! use embedded_io::{Read, ReadReady, Write};
//!
//! /// Turns every velocity node for a second.
//! fn turn<P, C>(port: P, clock: C, target: Rps) -> Result<(), DriveError<P::Error>>
//! where
//!     P: Read + ReadReady + Write,
//!     C: Clock,
//! {
//!     let master: Master = Master::new(MasterConfig::usb_adapter());
//!     let mut bus = Driver::new(master, port, clock);
//!     for (node, mode) in bus.discover()? {
//!         if mode == Mode::Velocity {
//!             bus.set_velocity(node, target)?;
//!         }
//!     }
//!     let end = bus.now() + Duration::from_millis(1000);
//!     while let Some(event) = bus.next_event(end)? {
//!         let _ = event; // a measurement, a change of a node's health, ...
//!     }
//!     bus.stop_all().map(drop)
//! }
//! # }
//! ```
//!
//! # How long a call takes
//!
//! [`service`](Driver::service) waits for nothing. All other calls end at a deadline, which is an
//! argument or follows from the role's settings. What a driver cannot bound is the port's own
//! `write` and `flush`: they have to return, with an error if need be.
//!
//! # What is kept
//!
//! * *Received bytes* are with the role before anything else is done. The port buffers what comes in
//!   while nobody reads: enough for the longest pause between two calls.
//! * *Bytes to be sent* stay in the driver until the port has taken them. After an error the next
//!   call goes on with them, so that no frame is cut; [`discard`](Driver::discard) gives them up.
//! * *Events* that a call meets and is not about are kept, 16 of them, and come out of
//!   [`poll_event`](Driver::poll_event) and [`next_event`](Driver::next_event) in their order. When
//!   there is no room the newest are refused and [counted](Driver::lost_events). What is not kept is
//!   what comes all the time and what the role has the latest of: a master's readings, a host's
//!   reports and pongs.
//! * *After an error* everything is as before it: call again.
//!
//! # Cancelling
//!
//! Async calls can be dropped at any await. What was received is with the role, what is to be sent
//! is in the driver, and the next call goes on. The port has its part in that: a `read` or `write`
//! that is dropped before it is ready must have moved no byte, and each round drops one `read`. Ports
//! with a buffer, such as embassy's `BufferedUart`, are of this kind; those that hand a caller's
//! buffer to a DMA channel for the time of one call are not.
//!
//! # With embassy
//!
//! ```text
//! let uart = BufferedUart::new(..);
//! let clock = || Instant::from_micros(embassy_time::Instant::now().as_micros());
//! let time = WithDelay { clock, delay: embassy_time::Delay };
//! let mut bus = Driver::new(Master::new(MasterConfig::direct()), uart, time);
//! let nodes = bus.discover_async().await?;
//! loop {
//!     let deadline = bus.now() + Duration::from_millis(100);
//!     match select(bus.next_event_async(deadline), COMMANDS.receive()).await {
//!         Either::First(event) => show(event?),
//!         Either::Second((node, target)) => bus.role_mut().set_velocity(node, target)?,
//!     }
//! }
//! ```
//!
//! # With RTIC
//!
//! RTIC 2 has async tasks: as with embassy, with `Mono::now()` as the clock and `Mono` as the delay.
//! Without them, a task calls the blocking [`service`](Driver::service), which does not wait, when the
//! receiver's interrupt has filled a queue and when the time of
//! [`poll_timeout`](Driver::poll_timeout) has come:
//!
//! ```text
//! #[task(local = [bus])]
//! fn talk(cx: talk::Context) {
//!     let bus = cx.local.bus; // its port: read_ready and read look at the queue of the interrupt
//!     if bus.service().is_err() { fault::spawn().ok(); }
//!     while let Some(event) = bus.poll_event() { show(event); }
//!     if let Some(at) = bus.poll_timeout() { wake_at(at); }
//! }
//! ```
//!
//! # Half duplex
//!
//! [`Directed`] (feature `embedded-hal`) switches the driver-enable pin of an RS485 transceiver. On
//! a line with two wires whose receiver stays on while it sends, set
//! [`removes_echo`](crate::ikeya::MasterConfig::removes_echo) of the master as well.

#[cfg(feature = "embedded-io-async")]
mod asynch;
#[cfg(feature = "embedded-io")]
mod blocking;
mod clock;
#[cfg(feature = "embedded-hal")]
mod direction;
mod error;
#[cfg(feature = "ikeya")]
mod ikeya;
#[cfg(feature = "ucp")]
mod ucp;

pub use clock::Clock;
#[cfg(feature = "std")]
pub use clock::StdClock;
#[cfg(feature = "embedded-io-async")]
pub use clock::WithDelay;
#[cfg(feature = "embedded-hal")]
pub use direction::{Directed, DirectedError, NoDelay};
pub use error::{DriveError, Wish};
#[cfg(feature = "ikeya")]
pub use ikeya::OnlineNodes;

use heapless::{Deque, Vec};

use crate::{endpoint::Endpoint, time::Instant};

/// Longest frame of any role, bytes.
const FRAME_LEN: usize = 64;

/// Events kept for the application at the most.
const KEPT: usize = 16;

/// Bytes read at once at the most.
const CHUNK_LEN: usize = 64;

/// Reads in one go at the most: 4096 bytes. A line is slower than that, a runaway port is not.
const READS: usize = 64;

/// Frames sent in one round at the most: a role that is flooded with requests could go on for ever.
const FRAMES: usize = 8;

/// A role with its port and its clock; see the [module](self) for what it does.
#[derive(Debug)]
pub struct Driver<R: Endpoint, P, C> {
    role: R,
    port: P,
    clock: C,
    /// The latest time that the role has been told.
    latest: Instant,
    /// What is left of the frame that is being sent.
    unsent: Vec<u8, FRAME_LEN>,
    /// Something has been sent since the last flush.
    unflushed: bool,
    kept: Deque<R::Event, KEPT>,
    lost_events: u32,
}

/// What a call does about an event that it meets.
#[cfg(any(feature = "ikeya", feature = "ucp"))]
enum Step<T, E> {
    /// It is what the call has been waiting for.
    Found(T),
    /// It is for the application.
    Keep(E),
    /// It is of no more use.
    Drop,
}

impl<R: Endpoint, P, C: Clock> Driver<R, P, C> {
    /// Puts a role, a port and a clock together. Roles that are made with a time get it from the
    /// same clock.
    pub fn new(role: R, port: P, mut clock: C) -> Self {
        let latest = clock.now();
        let (unsent, kept) = (Vec::new(), Deque::new());
        Self { role, port, clock, latest, unsent, unflushed: false, kept, lost_events: 0 }
    }

    /// The time, as the role is told it: a clock that goes backwards stands still.
    pub fn now(&mut self) -> Instant {
        self.latest = self.latest.max(self.clock.now());
        self.latest
    }

    /// The role.
    #[must_use]
    pub const fn role(&self) -> &R {
        &self.role
    }

    /// The role, to command it.
    ///
    /// Events taken from it here are newer than those that wait in the driver: take them from
    /// [`poll_event`](Self::poll_event).
    pub const fn role_mut(&mut self) -> &mut R {
        &mut self.role
    }

    /// The port.
    #[must_use]
    pub const fn port(&self) -> &P {
        &self.port
    }

    /// The port, to change its settings. Bytes read from it here are lost to the role, bytes written
    /// may land inside a frame.
    pub const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Role, port and clock; what is unsent and the events that were kept are given up.
    #[must_use]
    pub fn into_parts(self) -> (R, P, C) {
        (self.role, self.port, self.clock)
    }

    /// The next event that is there already, without touching the port.
    pub fn poll_event(&mut self) -> Option<R::Event> {
        self.kept.pop_front().or_else(|| self.role.poll_event())
    }

    /// When the next round has to be made at the latest, if no bytes come in.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.role.poll_timeout()
    }

    /// Events that there was no room to keep, besides those that the role counts itself.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.lost_events
    }

    /// Bytes of a frame that the port has not taken yet.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        &self.unsent
    }

    /// Gives up what is unsent, when a port has come back after a while; says how many bytes that
    /// were. The other end may have heard the beginning of the frame.
    pub fn discard(&mut self) -> usize {
        let discarded = self.unsent.len();
        self.unsent.clear();
        discarded
    }

    /// Hands in what a read has given.
    fn take<E>(&mut self, chunk: &[u8], count: usize) -> Result<(), DriveError<E>> {
        if count == 0 {
            return Err(DriveError::Closed);
        }
        let now = self.now();
        self.role.handle_input(chunk.get(..count).unwrap_or(chunk), now);
        Ok(())
    }

    /// Lets time pass.
    fn expire(&mut self) {
        let now = self.now();
        if self.role.poll_timeout().is_some_and(|at| now >= at) {
            self.role.handle_timeout(now);
        }
    }

    /// Is there something to send? The rest of a frame goes before the next one.
    fn load<E>(&mut self) -> Result<bool, DriveError<E>> {
        let now = self.now();
        if self.unsent.is_empty() {
            let Some(frame) = self.role.poll_transmit(now) else { return Ok(false) };
            let (length, limit) = (frame.len(), FRAME_LEN);
            let too_long = DriveError::FrameTooLong { length, limit };
            self.unsent.extend_from_slice(frame).map_err(|_| too_long)?;
            self.unflushed = true;
        }
        Ok(true)
    }

    /// The port has taken `count` bytes.
    fn sent(&mut self, count: usize) {
        self.unsent.drain(..count.min(self.unsent.len()));
    }

    /// When to look at the role again, until `deadline`.
    fn wake_at(&self, deadline: Instant) -> Instant {
        self.role.poll_timeout().map_or(deadline, |at| at.min(deadline))
    }

    /// Takes events out of the role until `step` finds one.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    fn sift<T>(&mut self, mut step: impl FnMut(R::Event) -> Step<T, R::Event>) -> Option<T> {
        while let Some(event) = self.role.poll_event() {
            match step(event) {
                Step::Found(found) => return Some(found),
                Step::Keep(event) => self.keep(event),
                Step::Drop => {}
            }
        }
        None
    }

    /// Keeps an event for the application.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    fn keep(&mut self, event: R::Event) {
        if self.kept.push_back(event).is_err() {
            self.lost_events = self.lost_events.saturating_add(1);
        }
    }
}
