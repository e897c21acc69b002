//! The contract that every role fulfils.

use crate::time::{Duration, Instant};

/// A role without a clock or a port: bytes and time go in; bytes, events and a deadline come out.
///
/// # The loop
///
/// To drive a role, repeat these steps in this order:
///
/// 1. call [`handle_input`](Self::handle_input) with the received bytes, if any;
/// 2. call [`handle_timeout`](Self::handle_timeout) if [`poll_timeout`](Self::poll_timeout) has
///    been reached;
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
/// the bytes behind it with [`handle_old_input`](Self::handle_old_input).
///
/// # When a port fails
///
/// If a frame was handed out but did not reach the line whole, call
/// [`handle_unsent`](Self::handle_unsent) before any other call. The role then decides again what
/// to send next: an old command is never sent late because a port was down, and a stop that was not
/// sent is due again (rulings I12, U16).
pub trait Endpoint {
    /// What the role reports to its application: small, owned values.
    type Event;

    /// Takes in all received bytes. All of them have arrived by `now`.
    fn handle_input(&mut self, bytes: &[u8], now: Instant);

    /// Takes in received bytes that may have arrived at any time from `since` to `now`: the caller
    /// was held up, or handed out a frame before it had read all of them. `since` may be before the
    /// time of earlier calls.
    ///
    /// By default the bytes count as received at `now`. A role that acts on commands dates them
    /// `since`, so that a stale command is not treated as new; a master does not take them for the
    /// answer to a request that was handed out after `since` (ruling I7).
    fn handle_old_input(&mut self, bytes: &[u8], since: Instant, now: Instant) {
        let _ = since;
        self.handle_input(bytes, now);
    }

    /// How long the port may go unread before the bytes found in it count as old. By default
    /// `None`: they never do.
    ///
    /// A role that acts on commands has such a limit. Check its port at least twice within it, and
    /// hand bytes that may have waited longer to [`handle_old_input`](Self::handle_old_input). Zero
    /// does not ask for more checks: all bytes then count from when the port was last seen empty.
    fn held_up_after(&self) -> Option<Duration> {
        None
    }

    /// Longest pause inside a frame that is sent, from the end of one byte to the end of the next;
    /// 20 ms by default (ruling U16).
    ///
    /// A frame with a longer pause is given up: the other end no longer waits for the rest, and
    /// would take it for something else.
    fn frame_pause(&self) -> Duration {
        Duration::from_millis(20)
    }

    /// The shortest time that `bytes` bytes take on the line; zero by default.
    ///
    /// If a port accepts a frame in parts, a driver has to know whether the frame paused between
    /// them for longer than [`frame_pause`](Self::frame_pause). The time of the bytes before the
    /// pause does not count. With zero, some frames that did not pause are given up.
    fn wire_time(&self, bytes: usize) -> Duration {
        let _ = bytes;
        Duration::ZERO
    }

    /// Lets time pass. Does nothing before [`poll_timeout`](Self::poll_timeout).
    fn handle_timeout(&mut self, now: Instant);

    /// The next bytes to send, if any: one frame, handed out once, to be sent from `now` on.
    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]>;

    /// The port has taken all of the last frame from [`poll_transmit`](Self::poll_transmit), but
    /// may still hold it. Does nothing by default.
    ///
    /// A driver whose port can hold bytes back calls this after the write that ended the frame,
    /// also of one that it then gives up, and [`handle_flushed`](Self::handle_flushed) once they
    /// have left: both or neither. A request that leaves late is answered late, and a master must
    /// not take that answer for the one to its next request (ruling I7).
    fn handle_taken(&mut self, now: Instant) {
        let _ = now;
    }

    /// All bytes that the port has taken have left by `now`. Does nothing by default.
    ///
    /// That a frame was given up is told before, by [`handle_unsent`](Self::handle_unsent).
    fn handle_flushed(&mut self, now: Instant) {
        let _ = now;
    }

    /// Whether the last frame from `poll_transmit` has become wrong since: its command was dropped
    /// or replaced, or others have spoken before its answer was out. `false` by default.
    ///
    /// A driver asks when it is called again after sending only part of a frame. If the frame is
    /// outdated, the driver gives up the rest, with [`Unsent::CutOff`].
    fn is_outdated(&self) -> bool {
        false
    }

    /// The last frame from `poll_transmit` did not reach the line whole, and no more of it will be
    /// sent.
    ///
    /// Does nothing by default: the frame is lost.
    fn handle_unsent(&mut self, unsent: Unsent, now: Instant) {
        let _ = (unsent, now);
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
