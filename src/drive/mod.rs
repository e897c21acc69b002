//! Drivers: a role, a port and a clock combined.
//!
//! A [`Driver`] runs the loop that [`Endpoint`] describes, and nothing else: it moves bytes between
//! a port and a role, tells the role the time, and keeps bytes that the port has not taken yet. The
//! role decides when to speak, what to repeat and what a timeout means. Its calls block, over the
//! traits of `embedded-io`: the port must implement `ReadReady`, and a call idles with
//! [`Clock::idle_until`]. [`asynch::Driver`] has the same calls for async code, over the traits of
//! `embedded-io-async` (feature of that name).
//!
//! Each role has high-level calls, such as [`discover`](Driver::discover) and
//! [`read`](Driver::read) of a master, [`drive`](Driver::drive) and
//! [`next_report`](Driver::next_report) of a host. Do everything else on the [role
//! itself](Driver::role_mut); it takes effect with the next call. A role talks only while one of
//! the driver's calls is running: if you stop calling, a master stops repeating its set-points.
//!
//! ```
//! # #[cfg(feature = "ikeya")] {
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
//!     config.nodes = [NodeId::N1, NodeId::N2].into(); // the whole bus
//!     let mut bus = Driver::master(config, port, clock);
//!     let moved = (|| {
//!         for (node, mode) in bus.discover()? {
//!             if mode == Mode::Velocity {
//!                 bus.set_velocity(node, target)?;
//!             }
//!         }
//!         bus.run_for(Duration::from_secs(1), |_, event, _| {
//!             let _ = event; // a measurement, a change of a node's health, ...
//!         })
//!     })();
//!     bus.stop_all()?; // whatever has failed; waits until every motor is seen to be still
//!     moved
//! }
//! # }
//! ```
//!
//! # How long a call takes
//!
//! [`service`](Driver::service) does not wait. All other calls end after a time that is an
//! argument or follows from the role's settings. The blocking calls cannot bound the port's own
//! `write` and `flush`: these must return, with an error if need be. The async calls give up on
//! either after one second ([`DriveError::Stalled`]), and may meet one such wait behind another. A
//! slave or a robot waits for its port for less in each call: for half of
//! [`LineRules::held_up_after`], or for two of its longest frames and a millisecond if that is
//! longer, by which time a healthy port is done. Then its application hears of a watchdog at most
//! four such times late, and a call may leave a frame, and a driver-enable pin, to the next one.
//! While a write of a frame's first bytes waits, the driver looks at what is received, after twice
//! the time of those bytes and a millisecond, and again and again: a command does not leave that
//! has ended by then, by a dead-man, because its call is over, or because its node has answered in
//! the other mode; nor a hold whose measurement is old.
//!
//! # When a driver is held up
//!
//! Received bytes carry no time of arrival. A slave or a robot must not treat a ten-second-old
//! command as new, so its driver checks the port repeatedly while it waits, twice per
//! [`LineRules::held_up_after`]. If it has not seen the port empty for longer than that, because of
//! its caller, another task, or a slow `write` or `flush`, the bytes that it finds count as
//! received when the port was last seen empty ([`Arrival::Between`]). A host's reports
//! always do, where it matters whether they are from before a stop.
//!
//! So call the driver of a slave or a robot no later than [`poll_timeout`](Driver::poll_timeout): a
//! slave that is called too rarely does not answer, and a command counts for less time. The driver
//! cannot date bytes that wait outside the port, in an adapter or another task, or that were there
//! before it was made.
//!
//! # When a port fails
//!
//! A failure is returned and breaks nothing: call again.
//!
//! * *A receiver that fails* does not keep the driver from sending: it first sends and flushes what
//!   is due, then returns the error. So stops still leave, and the driver-enable pin goes off. In
//!   all roles but a master, the beginning of a frame waits for 20 ms for a rest that may still be
//!   in the port. So do the answers and reports of a slave or a robot: the requests behind may have
//!   overtaken them.
//! * *A frame of which no byte has left* goes back to its role, which decides again what to send:
//!   an old command is never sent late.
//! * *A frame that was cut off* continues with the next call, unless its last byte left too long
//!   ago: the other end no longer waits for the rest ([`LineRules::frame_pause`], at most 20 ms);
//!   or unless the frame has become wrong since ([`Endpoint::is_outdated`]: a command that was
//!   replaced or stopped, an answer that others have overtaken). In these cases the driver gives it
//!   up and tells the role, which sends a stop twice (ruling U16).
//! * *A frame that the port took in parts* counts as sent only if it cannot have paused for that
//!   long in between: it is flushed at once, and must be out in hardly more than its time on the
//!   line ([`LineRules::baud`]). Otherwise it is given up as well. So `flush` must wait until the
//!   bytes are out, and a port should take whole frames: of one that it took in a single `write`,
//!   it must not send a part and hold the rest.
//! * *After a failed `flush`* the role counts its latest commands as not sent, and a frame that was
//!   cut off has no rest. The port is flushed once more before it takes the next frame.
//! * *A request that the port still holds*, because its `flush` has failed or its call was dropped,
//!   will be answered late. A master keeps the line free for that answer, for a second at most. As
//!   long as no `flush` succeeds it sends on after that, stops included, but takes no answer: it
//!   could be that of an earlier request ([`Transmit::Taken`]).
//!
//! # What is kept
//!
//! * *Received bytes* are handed to the role before anything else is done. The port must buffer
//!   what arrives during the longest pause between two calls.
//! * *Events* stay in the role's queue, in order, until [`poll_event`](Driver::poll_event) or
//!   [`next_event`](Driver::next_event) takes them out. Frequent events (a master's readings, a
//!   host's reports and pongs) never take the room of rare ones, and calls that wait for something
//!   else drop them: the role has the latest.
//!
//! # On a PC
//!
//! `SerialPort` (feature `serialport`) with `StdClock`, or `TokioSerialPort` with `TokioClock`
//! (feature `tokio`): see `guide::start_on_a_pc`.
//!
//! # With RTIC
//!
//! RTIC 2 has async tasks: proceed as [with embassy](asynch), with `Mono::now()` as the clock and
//! `Mono` as the delay. Without async tasks, call the blocking [`service`](Driver::service), which
//! does not wait, from a task. Spawn the task when the receiver's interrupt has filled a queue, and
//! at [`poll_timeout`](Driver::poll_timeout):
//!
//! ```text
//! #[task(local = [bus])]
//! fn talk(cx: talk::Context) {
//!     let bus = cx.local.bus; // its port: read_ready and read use the interrupt's queue
//!     if bus.service().is_err() { fault::spawn().ok(); }
//!     while let Some(event) = bus.poll_event() { show(event); }
//!     if let Some(at) = bus.poll_timeout() { wake_at(at); }
//! }
//! ```
//!
//! # Half duplex
//!
//! [`Rs485`] switches the driver-enable pin of an RS485 transceiver. On a
//! two-wire line whose receiver stays on while sending, put a [`WithoutEcho`] around the port.
//!
//! [`Endpoint`]: crate::endpoint::Endpoint
//! [`Arrival::Between`]: crate::endpoint::Arrival::Between
//! [`LineRules::baud`]: crate::endpoint::LineRules::baud
//! [`LineRules::frame_pause`]: crate::endpoint::LineRules::frame_pause
//! [`LineRules::held_up_after`]: crate::endpoint::LineRules::held_up_after
//! [`Transmit::Taken`]: crate::endpoint::Transmit::Taken
//! [`Endpoint::is_outdated`]: crate::endpoint::Endpoint::is_outdated

#[macro_use]
mod worlds;

#[cfg(feature = "embedded-io-async")]
pub mod asynch;
mod blocking;
mod calls;
mod clock;
mod driver;
mod error;
#[cfg(feature = "ikeya")]
mod ikeya;
mod looks;
#[cfg(all(feature = "serialport", any(feature = "ikeya", feature = "ucp")))]
mod opened;
mod rs485;
mod sending;
#[cfg(feature = "serialport")]
mod serial_port;
#[cfg(feature = "tokio")]
mod tokio;
#[cfg(any(feature = "serialport", feature = "tokio"))]
mod tty;
#[cfg(feature = "ucp")]
mod ucp;
mod without_echo;

pub use clock::Clock;
#[cfg(feature = "std")]
pub use clock::StdClock;
#[cfg(feature = "embedded-io-async")]
pub use clock::WithDelay;
pub use driver::Driver;
pub use error::{DriveError, Operation};
#[cfg(feature = "ikeya")]
pub use ikeya::OnlineNodes;
#[cfg(all(feature = "serialport", feature = "ikeya"))]
pub use opened::Bus;
#[cfg(all(feature = "serialport", feature = "ucp"))]
pub use opened::Rover;
pub use rs485::{NoDelay, Rs485, Rs485Error};
#[cfg(feature = "serialport")]
pub use serial_port::SerialPort;
#[cfg(feature = "tokio")]
pub use tokio::{TokioClock, TokioSerialPort};
pub use without_echo::WithoutEcho;
