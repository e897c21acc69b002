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
//! use axlewire::ikeya::{master::MasterConfig, Master, Mode, NodeId, Rps};
//! use axlewire::time::Duration;
//! use embedded_io::{Read, ReadReady, Write};
//!
//! /// Turns every velocity node for a second.
//! fn turn<P, C>(port: P, clock: C, target: Rps) -> Result<(), DriveError<P::Error>>
//! where
//!     P: Read + ReadReady + Write,
//!     C: Clock,
//! {
//!     let mut config = MasterConfig::usb_adapter();
//!     config.nodes = [NodeId::N1, NodeId::N2].into_iter().collect(); // the whole bus
//!     let mut bus: Driver<Master, _, _> = Driver::with(|now| Master::new(config, now), port, clock);
//!     for (node, mode) in bus.discover()? {
//!         if mode == Mode::Velocity {
//!             bus.set_velocity(node, target)?;
//!         }
//!     }
//!     let end = bus.now() + Duration::from_millis(1000);
//!     while let Some(event) = bus.next_event(end)? {
//!         let _ = event; // a measurement, a change of a node's health, ...
//!     }
//!     bus.stop_all() // waits until every node has confirmed its stop, twice
//! }
//! # }
//! ```
//!
//! # How long a call takes
//!
//! [`service`](Driver::service) waits for nothing. All other calls end at a deadline, which is an
//! argument or follows from the role's settings. What the blocking calls cannot bound is the port's own
//! `write` and `flush`: they have to return, with an error if need be. The async calls give up on
//! either after a second ([`DriveError::Stalled`]).
//!
//! # When a driver is held up
//!
//! Received bytes do not say when they came. A slave or a robot must not obey a command of ten
//! seconds ago like a new one, so its driver looks at the port again and again while it waits,
//! twice in each [`Endpoint::held_up_after`]. When it has not seen the port empty for longer than that,
//! because of its caller, another task, or a `write` or `flush` that took long, what it finds
//! counts as received when the port was last seen empty ([`Endpoint::handle_old_input`]).
//!
//! So call a driver of a slave or a robot at the latest at [`poll_timeout`](Driver::poll_timeout):
//! a slave that is called too seldom does not answer, and a command counts for less time. What
//! waits outside of the port, in an adapter or another task, and what was there before the driver
//! was made, is beyond it.
//!
//! # When a port fails
//!
//! A failure is returned, and breaks nothing: call again.
//!
//! * *A receiver that fails* does not keep the driver from sending: what is due is sent and flushed
//!   first, then the error is returned. So stops leave, and the driver-enable pin goes off.
//! * *A frame of which no byte has left* goes back to its role, which decides anew what to send: an
//!   old command is never sent late.
//! * *A frame that was cut off* goes on with the next call, unless its last byte left so long ago that
//!   the other end no longer waits for the rest ([`Endpoint::frame_pause`], at most 20 ms), or it has
//!   become wrong since ([`Endpoint::is_outdated`]: a command that was replaced or stopped, an answer
//!   that others have overtaken). Then it is given up and the role is told, which sends a stop twice
//!   (ruling U16).
//! * *A frame that the port took in parts* counts as sent only if it cannot have paused for that long
//!   in between: each `write` came back before the bytes in front of its own could have been out for
//!   so long, or the whole frame was flushed in hardly more than its time on the line
//!   ([`Endpoint::wire_time`]). So `flush` has to wait until the bytes are out, and a port that takes
//!   a part of a frame has to be asked for the rest in time. Otherwise it is given up as well.
//! * *After a failed `flush`* the role counts its latest commands as not sent.
//!
//! # What is kept
//!
//! * *Received bytes* are with the role before anything else is done. The port buffers what comes in
//!   while nobody reads: enough for the longest pause between two calls.
//! * *Events* stay in the role's queue until [`poll_event`](Driver::poll_event) or
//!   [`next_event`](Driver::next_event) takes them out, in their order. What comes all the time (a
//!   master's readings, a host's reports and pongs) never takes the room of what is rare, and is
//!   dropped by calls that wait for something else: the role has the latest.
//!
//! # Cancelling
//!
//! Async calls can be dropped at any await. What was received is with the role, what is to be sent
//! is with the role or in the driver, and the next call goes on; a `drive_for_async` that is dropped
//! leaves a stop that the next call sends. The port has its part in that: a `read` or `write`
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
//! let mut bus = Driver::with(|now| Master::new(MasterConfig::direct(), now), uart, time);
//! let nodes = bus.discover_async().await?;
//! loop {
//!     let deadline = bus.now() + Duration::from_millis(100);
//!     match select(bus.next_event_async(deadline), COMMANDS.receive()).await {
//!         Either::First(event) => show(event?),
//!         Either::Second((node, target)) => bus.set_velocity_async(node, target).await?,
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
//! [`Rs485`] (feature `embedded-hal`) switches the driver-enable pin of an RS485 transceiver. On
//! a line with two wires whose receiver stays on while it sends, set
//! [`removes_echo`](crate::ikeya::master::MasterConfig::removes_echo) of the master as well.

#[cfg(feature = "embedded-io-async")]
mod asynch;
#[cfg(feature = "embedded-io")]
mod blocking;
mod clock;
mod error;
#[cfg(feature = "ikeya")]
mod ikeya;
mod outbox;
#[cfg(feature = "embedded-hal")]
mod rs485;
#[cfg(feature = "ucp")]
mod ucp;

pub use clock::Clock;
#[cfg(feature = "std")]
pub use clock::StdClock;
#[cfg(feature = "embedded-io-async")]
pub use clock::WithDelay;
pub use error::{DriveError, Operation};
#[cfg(feature = "ikeya")]
pub use ikeya::OnlineNodes;
#[cfg(feature = "embedded-hal")]
pub use rs485::{NoDelay, Rs485, Rs485Error};

use crate::{
    endpoint::{Endpoint, Unsent},
    time::{Duration, Instant, earliest},
};
use outbox::Outbox;

/// Bytes read at once at the most.
const CHUNK_LEN: usize = 64;

/// Reads in one go at the most: 4096 bytes. A line is slower than that, a runaway port is not.
const READS: usize = 64;

/// Frames sent in one round at the most: a role that is flooded with requests could go on for ever.
const FRAMES: usize = 8;

/// What a call needs of its port before it looks at the role.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Needs {
    /// A round without a failure.
    WholePort,
    /// The half that works may be enough: a command was received, a stop has left.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    HalfPort,
}

/// A role with its port and its clock; see the [module](self) for what it does.
#[derive(Clone, Debug)]
pub struct Driver<R, P, C> {
    role: R,
    port: P,
    clock: C,
    /// The latest time that the role has been told.
    latest: Instant,
    /// What the role's time is ahead of the clock, microseconds: by as much as that ever went back.
    ahead_us: u64,
    /// When the port was last looked at for received bytes.
    looked_at: Instant,
    /// When it was last seen empty: all that is received has arrived since.
    empty_at: Instant,
    outbox: Outbox,
}

impl<R: Endpoint, P, C: Clock> Driver<R, P, C> {
    /// Pause after an error of the port in a call that goes on all the same.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    const ERROR_NAP: Duration = Duration::from_millis(1);

    /// Puts a role, a port and a clock together. The role must have been made with a time of the
    /// same clock; [`with`](Self::with) sees to that.
    pub fn new(role: R, port: P, mut clock: C) -> Self {
        let latest = clock.now();
        Self {
            role,
            port,
            clock,
            latest,
            ahead_us: 0,
            looked_at: latest,
            empty_at: latest,
            outbox: Outbox::new(),
        }
    }

    /// The same with a role that is made here, at the time of this clock.
    pub fn with(role: impl FnOnce(Instant) -> R, port: P, mut clock: C) -> Self {
        let latest = clock.now();
        Self::new(role(latest), port, clock)
    }

    /// The time, as the role is told it. When the clock goes backwards, the role's time goes on from
    /// where it was: one wrong reading must not stop it.
    pub fn now(&mut self) -> Instant {
        let reading = self.clock.now().as_micros();
        let now = Instant::from_micros(reading.wrapping_add(self.ahead_us));
        if now < self.latest {
            self.ahead_us = self.latest.as_micros().wrapping_sub(reading);
        } else {
            self.latest = now;
        }
        self.latest
    }

    /// The role.
    #[must_use]
    pub const fn role(&self) -> &R {
        &self.role
    }

    /// The role, to command it.
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

    /// Role, port and clock; what is unsent is given up.
    #[must_use]
    pub fn into_parts(self) -> (R, P, C) {
        (self.role, self.port, self.clock)
    }

    /// The next event that is there already, without touching the port.
    pub fn poll_event(&mut self) -> Option<R::Event> {
        self.role.poll_event()
    }

    /// When the next round has to be made at the latest, if no bytes come in.
    ///
    /// Never `None` for a slave or a robot, even while it has nothing to do: bytes that are found
    /// after a longer time may be old, and are not obeyed or answered like new ones
    /// ([`Endpoint::held_up_after`]).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let look_at = self
            .role
            .held_up_after()
            .map(|limit| self.looked_at + Duration::from_micros(limit.as_micros() / 2));
        earliest(&[self.role.poll_timeout(), look_at])
    }

    /// Bytes of a frame that the port has not taken yet.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        self.outbox.rest()
    }

    /// Gives up what is unsent or not flushed, when a port has come back after a while; returns the
    /// number of bytes given up. The role counts it as not sent. The other end may have heard the
    /// beginning of the frame.
    pub fn discard(&mut self) -> usize {
        let discarded = self.outbox.rest().len();
        let given_up = self.outbox.give_up();
        self.tell_unsent(given_up);
        self.unflushed();
        discarded
    }

    /// Lets the role decide anew about a frame that did not leave.
    fn reclaim(&mut self) {
        let now = self.now();
        let unsent = self.outbox.reclaim(now, self.silence());
        self.tell_unsent(unsent);
    }

    /// Longest silence inside a frame. The other end measures from byte to byte, and the first one
    /// behind the silence takes its time.
    fn silence(&self) -> Duration {
        let (pause, byte) = (self.role.frame_pause(), self.role.wire_time(1));
        Duration::from_micros(pause.as_micros().saturating_sub(byte.as_micros()))
    }

    fn tell_unsent(&mut self, unsent: Option<Unsent>) {
        let now = self.now();
        if let Some(unsent) = unsent {
            self.role.handle_unsent(unsent, now);
        }
    }

    /// Hands in what a read has given. Unless the port was seen empty a short while ago, the driver
    /// was held up, in a call of the port, by its caller or by another task, and the bytes may have
    /// arrived at any time since then.
    fn receive_chunk<E>(&mut self, chunk: &[u8], count: usize) -> Result<(), DriveError<E>> {
        if count == 0 {
            return Err(DriveError::Closed);
        }
        let now = self.now();
        let bytes = chunk.get(..count).unwrap_or(chunk);
        match self.role.held_up_after() {
            Some(limit) if now - self.empty_at > limit => {
                self.role.handle_old_input(bytes, self.empty_at, now);
            }
            _ => self.role.handle_input(bytes, now),
        }
        Ok(())
    }

    /// The port is looked at for received bytes now, or a little later.
    fn look(&mut self) {
        self.looked_at = self.latest;
    }

    /// The port was empty at `latest` or a little later. A short read does not show that: a
    /// ring buffer gives only what lies in front of its end.
    fn saw_empty(&mut self) {
        self.empty_at = self.latest;
    }

    /// Lets time pass.
    fn expire(&mut self) {
        let now = self.now();
        if self.role.poll_timeout().is_some_and(|at| now >= at) {
            self.role.handle_timeout(now);
        }
    }

    /// Is there something to send? The rest of a frame goes before the next one, unless it is
    /// outdated.
    fn load<E>(&mut self) -> Result<bool, DriveError<E>> {
        let now = self.now();
        if !self.outbox.rest().is_empty() && self.role.is_outdated() {
            let given_up = self.outbox.give_up();
            self.tell_unsent(given_up);
        }
        if self.outbox.rest().is_empty() {
            let Some(frame) = self.role.poll_transmit(now) else { return Ok(false) };
            self.outbox.load(frame)?;
        }
        Ok(true)
    }

    /// The port is about to be asked to take what is unsent.
    fn before_write(&mut self) {
        let now = self.now();
        self.outbox.begin_write(now);
    }

    /// What a write has done: the port has taken bytes, or it has failed.
    fn after_write<E>(&mut self, written: Result<usize, E>) -> Result<(), DriveError<E>> {
        let now = self.now();
        let failure = match written {
            Ok(0) => DriveError::WriteZero,
            Ok(count) => {
                let (time, silence) = (self.role.wire_time(count), self.silence());
                let unsent = self.outbox.sent(count, time, now, silence);
                self.tell_unsent(unsent);
                return Ok(());
            }
            Err(error) => DriveError::Port(error),
        };
        self.reclaim();
        Err(failure)
    }

    fn after_flush<E>(&mut self, flushed: Result<(), E>) -> Result<(), DriveError<E>> {
        if let Err(error) = flushed {
            self.unflushed();
            return Err(DriveError::Port(error));
        }
        let now = self.now();
        let unsent = self.outbox.flushed(now, self.silence());
        self.tell_unsent(unsent);
        Ok(())
    }

    /// What was sent since the last flush may not have left.
    fn unflushed(&mut self) {
        if self.outbox.is_in_doubt() {
            let given_up = self.outbox.give_up();
            self.tell_unsent(given_up);
        }
        let unsent = self.outbox.flush_failed();
        self.tell_unsent(unsent);
    }

    /// Has the port let go of everything that the role has handed out?
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    fn is_sent(&self) -> bool {
        self.outbox.rest().is_empty() && !self.outbox.needs_flush()
    }

    /// The same moment on the clock of the user.
    #[cfg(feature = "embedded-io")]
    fn on_clock(&self, at: Instant) -> Instant {
        Instant::from_micros(at.as_micros().wrapping_sub(self.ahead_us))
    }

    /// When to look at the role again, until `deadline`.
    fn wake_at(&self, deadline: Instant) -> Instant {
        self.poll_timeout().map_or(deadline, |at| at.min(deadline))
    }
}
