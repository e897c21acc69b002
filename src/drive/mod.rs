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
mod driver;
mod error;
#[cfg(feature = "ikeya")]
mod ikeya;
#[cfg(feature = "embedded-hal")]
mod rs485;
mod sending;
#[cfg(feature = "ucp")]
mod ucp;

pub use clock::Clock;
#[cfg(feature = "std")]
pub use clock::StdClock;
#[cfg(feature = "embedded-io-async")]
pub use clock::WithDelay;
pub use driver::Driver;
pub use error::{DriveError, Operation};
#[cfg(feature = "ikeya")]
pub use ikeya::OnlineNodes;
#[cfg(feature = "embedded-hal")]
pub use rs485::{NoDelay, Rs485, Rs485Error};
