//! The one contract that every role obeys.

use crate::time::{Duration, Instant};

/// A role without a clock and without a port: bytes and time go in, bytes, events and a deadline
/// come out.
///
/// # The loop
///
/// Whoever drives a role does this, again and again, in this order:
///
/// 1. [`handle_input`](Self::handle_input) with what has been received, if anything;
/// 2. [`handle_timeout`](Self::handle_timeout) if [`poll_timeout`](Self::poll_timeout) has been reached;
/// 3. [`poll_event`](Self::poll_event) until it is `None`; commands to the role go in here;
/// 4. [`poll_transmit`](Self::poll_transmit) until it is `None`, sending each answer whole, at once;
/// 5. wait for bytes, for the next command or for `poll_timeout`, whichever is first.
///
/// `now` never goes backwards from one call to the next. Every call returns at once: its work is
/// bounded by the bytes that it is given, and it never blocks, allocates or panics. A call too many
/// does nothing: input of no bytes, a timeout that has not been reached, a poll with nothing to
/// give.
///
/// Bytes that have been received are to be handed in *before* the next `poll_transmit`: a master
/// tells an answer from a leftover by it (ruling I7).
///
/// # When a port fails
///
/// A frame that was handed out and did not reach the line whole is told to
/// [`handle_unsent`](Self::handle_unsent), before anything else is asked of the role. The role then
/// decides anew what goes next: an old command is never sent late because a port was down, and a
/// stop that was not sent is due again (rulings I12, U16).
pub trait Endpoint {
    /// What the role tells its application: small, owned values.
    type Event;

    /// Takes in received bytes, all of them. `now` is when the last of them had arrived.
    fn handle_input(&mut self, bytes: &[u8], now: Instant);

    /// Takes in received bytes that may have arrived at any time from `since` to `now`: whoever reads
    /// the port was held up. `since` may be before the time of earlier calls.
    ///
    /// As provided they count as arrived now. A role that obeys commands dates them `since`, so that
    /// an old command is not obeyed like a new one.
    fn handle_old_input(&mut self, bytes: &[u8], since: Instant, now: Instant) {
        let _ = since;
        self.handle_input(bytes, now);
    }

    /// How long the port may go unread before what is found in it counts as old; `None` as
    /// provided: never.
    ///
    /// A role that obeys commands has such a time. Look at its port at least twice in it, and hand
    /// bytes that may have waited longer to [`handle_old_input`](Self::handle_old_input).
    fn held_up_after(&self) -> Option<Duration> {
        None
    }

    /// Longest pause inside a frame that is sent, from the end of a byte to the end of the next; 20 ms
    /// as provided (ruling U16).
    ///
    /// A frame that pauses longer is given up: the other end no longer waits for the rest, and would
    /// take it for something else.
    fn frame_pause(&self) -> Duration {
        Duration::from_millis(20)
    }

    /// The shortest time that this number of sent bytes takes on the line; zero as provided.
    ///
    /// When a port takes a frame in parts, a driver has to know whether the frame paused between them
    /// for longer than [`frame_pause`](Self::frame_pause). The time of the bytes before the pause does
    /// not count. With zero, some frames that did not pause are given up.
    fn wire_time(&self, bytes: usize) -> Duration {
        let _ = bytes;
        Duration::ZERO
    }

    /// Lets time pass. Before [`poll_timeout`](Self::poll_timeout) it does nothing.
    fn handle_timeout(&mut self, now: Instant);

    /// The next bytes to send, if any: one frame, handed out once, to be sent from `now` on.
    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]>;

    /// Has the frame that `poll_transmit` handed out last become wrong since? Its command has been
    /// dropped or replaced, or others have spoken before its answer was out. Never, as provided.
    ///
    /// A driver asks when it could send only a part of a frame and is called again. It gives up the
    /// rest of one that is outdated, with [`Unsent::CutOff`].
    fn is_outdated(&self) -> bool {
        false
    }

    /// The frame that `poll_transmit` handed out last did not reach the line whole. Nothing of it
    /// will be sent any more.
    ///
    /// As provided it does nothing: the frame is lost.
    fn handle_unsent(&mut self, unsent: Unsent, now: Instant) {
        let _ = (unsent, now);
    }

    /// The next event, if any, in the order in which they happened.
    ///
    /// There is room for a fixed number of events. When nobody takes them out, the newest are
    /// refused and counted, and the oldest are kept; what comes all the time is refused first.
    ///
    /// An event that waits here counts as found: a role acknowledges to the other end what has room
    /// in its queue, and no more (ruling U15). So do not take an event out without room to keep it:
    /// leave it here.
    fn poll_event(&mut self) -> Option<Self::Event>;

    /// When to call [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_transmit`](Self::poll_transmit) again at the latest; `None` if only bytes or commands
    /// can change anything. To be asked anew after any other call.
    fn poll_timeout(&self) -> Option<Instant>;
}

/// How much of a frame has left, when a port could not send it.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unsent {
    /// Not a byte of it has left.
    Untouched,
    /// A part of it has left: the other end may take the bytes of the next frame for the rest.
    CutOff,
    /// The port took all of it and then failed to flush. It may have left, and so may the frames
    /// that were handed out since the last flush.
    Unflushed,
}
