//! The contract that every role fulfils.

use crate::time::{self, Duration, Instant};

/// A role without a clock or a port: bytes and time go in; bytes, events and a deadline come out.
///
/// # The loop
///
/// To drive a role, repeat these steps in this order:
///
/// 1. call [`handle_input`](Self::handle_input) with the received bytes, if any;
/// 2. call [`handle_timeout`](Self::handle_timeout) if [`poll_timeout`](Self::poll_timeout) has
///    been reached, with a time read before the port was last found empty: bytes that have come
///    since belong before that timeout;
/// 3. call [`poll_event`](Self::poll_event) until it returns `None`; give commands to the role
///    here;
/// 4. call [`poll_transmit`](Self::poll_transmit) until it returns `None`, and send each frame
///    whole, at once;
/// 5. wait for bytes, for the next command or for `poll_timeout`, whichever comes first.
///
/// `now` must never go backwards. Every call returns at once: its work is bounded by the bytes that
/// it is given, and it never blocks, allocates or panics. Spurious calls are harmless: empty input,
/// a timeout that has not been reached, a poll with nothing to return.
///
/// Hand in *all* received bytes before the next `poll_transmit`: a master uses this order to tell
/// answers from stale bytes (ruling I7). If you cannot, because the port fails or is full, hand in
/// the bytes behind it with an older [`Arrival`].
///
/// # When a port fails
///
/// If a frame was handed out but did not reach the line whole, tell the role with
/// [`handle_transmit`](Self::handle_transmit) before any other call. The role then decides again
/// what to send next: an old command is never sent late because a port was down, and a stop that
/// was not sent is due again (rulings I12, U16).
///
/// # A role of your own
///
/// Five methods are enough; the others have defaults. This one sends back what it hears:
///
/// ```
/// use axlewire::{endpoint::{Arrival, Endpoint}, time::Instant};
///
/// #[derive(Default)]
/// struct Mirror {
///     heard: Vec<u8>,
///     sent: Vec<u8>,
/// }
///
/// impl Endpoint for Mirror {
///     type Event = ();
///     fn handle_input(&mut self, bytes: &[u8], _arrived: impl Into<Arrival>) {
///         self.heard.extend(bytes);
///     }
///     fn handle_timeout(&mut self, _now: Instant) {}
///     fn poll_transmit(&mut self, _now: Instant) -> Option<&[u8]> {
///         self.sent = std::mem::take(&mut self.heard);
///         (!self.sent.is_empty()).then_some(&self.sent)
///     }
///     fn poll_event(&mut self) -> Option<()> {
///         None
///     }
///     fn poll_timeout(&self) -> Option<Instant> {
///         None
///     }
/// }
///
/// let (mut mirror, now) = (Mirror::default(), Instant::from_micros(0));
/// mirror.handle_input(b"hello", now);
/// assert_eq!(mirror.poll_transmit(now), Some(&b"hello"[..]));
/// assert_eq!(mirror.poll_transmit(now), None);
/// ```
pub trait Endpoint {
    /// What the role reports to its application: small, owned values.
    type Event;

    /// Takes in all received bytes. Pass the time as an [`Instant`] if all of them have just
    /// arrived, and as an [`Arrival`] if some may have waited.
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>);

    /// Lets time pass. Does nothing before [`poll_timeout`](Self::poll_timeout).
    fn handle_timeout(&mut self, now: Instant);

    /// The next bytes to send, if any: one frame, handed out once, to be sent from `now` on.
    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]>;

    /// What has become of the frames from [`poll_transmit`](Self::poll_transmit): a [`Transmit`],
    /// or an [`Unsent`]. Does nothing by default: a frame that did not leave is lost.
    ///
    /// If the port can hold bytes back, tell of [`Transmit::Taken`] after the write that ended a
    /// frame, also of one that is then given up, and of [`Transmit::Flushed`] once the bytes have
    /// left: both or neither. A request that leaves late is answered late, and a master must not
    /// take that answer for the one to its next request (ruling I7).
    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        let _ = (outcome, now);
    }

    /// Whether the last frame from `poll_transmit` has become wrong since: its command was dropped
    /// or replaced, or others have spoken before its answer was out. `false` by default.
    ///
    /// A driver asks when it is called again after sending only part of a frame. If the frame is
    /// outdated, the driver gives up the rest, with [`Unsent::CutOff`].
    fn is_outdated(&self) -> bool {
        false
    }

    /// What the role requires of its line. Ask again when the settings have changed.
    fn line_rules(&self) -> LineRules {
        LineRules::default()
    }

    /// The next event, if any, in the order of occurrence.
    ///
    /// The queue has a fixed size. If it fills, the newest events are refused and counted, and the
    /// oldest are kept; frequent events are refused first.
    ///
    /// An event in the queue counts as delivered: a role acknowledges to the other end only what
    /// fits into its queue (ruling U15). So if you have no room for an event, leave it here.
    fn poll_event(&mut self) -> Option<Self::Event>;

    /// When to call [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_transmit`](Self::poll_transmit) again at the latest; `None` if only bytes or commands
    /// can change anything. Ask again after every other call.
    fn poll_timeout(&self) -> Option<Instant>;
}

/// When received bytes have arrived: at a time, or at any time from one to another.
///
/// An [`Instant`] converts into it.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Arrival {
    /// All of them have just arrived.
    Now(Instant),
    /// They may have waited: the caller was held up, or handed out a frame before it had read all
    /// of them.
    ///
    /// A role that acts on commands dates such bytes `since`, so that a stale command is not
    /// treated as new; a master does not take them for the answer to a request that was handed
    /// out after `since` (ruling I7).
    ///
    /// With an empty slice: none could be read, although some may wait. A host then takes its robot
    /// for standing still only after three more reports (U16).
    Between {
        /// The earliest time at which they can have arrived. May be before the time of earlier
        /// calls.
        since: Instant,
        /// The current time.
        now: Instant,
    },
}

impl Arrival {
    /// The current time: they have arrived by now.
    #[must_use]
    pub const fn now(self) -> Instant {
        match self {
            Self::Now(now) | Self::Between { now, .. } => now,
        }
    }

    /// The earliest time at which they can have arrived.
    #[must_use]
    pub const fn since(self) -> Instant {
        match self {
            Self::Now(since) | Self::Between { since, .. } => since,
        }
    }
}

impl From<Instant> for Arrival {
    fn from(now: Instant) -> Self {
        Self::Now(now)
    }
}

/// What a role requires of its line, see [`Endpoint::line_rules`].
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineRules {
    /// Longest pause inside a frame that is sent, from the end of one byte to the end of the next.
    ///
    /// A frame with a longer pause is given up: the other end no longer waits for the rest, and
    /// would take it for something else.
    pub frame_pause: Duration,
    /// Speed of the line, bit/s, 10 bits per byte; 0 if it is not known.
    ///
    /// If a port accepts a frame in parts, a driver has to know whether the frame paused between
    /// them for longer than `frame_pause`. The time of the bytes before the pause does not count.
    /// With 0, some frames that did not pause are given up.
    pub baud: u32,
    /// How long the port may go unread before the bytes found in it count as old; `None` if they
    /// never do.
    ///
    /// A role that acts on commands has such a limit. Check its port at least twice within it, and
    /// hand in bytes that may have waited longer with an older [`Arrival`]. Zero does not ask for
    /// more checks: all bytes then count from when the port was last seen empty.
    pub held_up_after: Option<Duration>,
}

/// A pause of 20 ms (ruling U16), a line of unknown speed, and bytes that are never old.
impl Default for LineRules {
    fn default() -> Self {
        Self { frame_pause: Duration::from_millis(20), baud: 0, held_up_after: None }
    }
}

impl LineRules {
    /// The shortest time that `bytes` bytes take on the line; zero if its speed is not known.
    #[must_use]
    pub const fn wire_time(&self, bytes: usize) -> Duration {
        if self.baud == 0 { Duration::ZERO } else { time::wire_time(bytes, self.baud) }
    }
}

/// What has become of a frame, see [`Endpoint::handle_transmit`].
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Transmit {
    /// The port has taken all of the last frame, but may still hold it.
    Taken,
    /// All bytes that the port has taken have left by now. That a frame was given up is told
    /// before.
    Flushed,
    /// The last frame did not reach the line whole, and no more of it will be sent.
    Unsent(Unsent),
}

impl From<Unsent> for Transmit {
    fn from(unsent: Unsent) -> Self {
        Self::Unsent(unsent)
    }
}

/// How much of a frame has left, when a port could not send it whole.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unsent {
    /// None of it has left.
    Untouched,
    /// Part of it has left: the other end may take the bytes of the next frame for the rest.
    CutOff,
    /// The port took all of it and then failed to flush. It may have left, and so may all frames
    /// handed out since the last flush.
    Unflushed,
}
