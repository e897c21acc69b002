//! The one contract that every role obeys.

use crate::time::Instant;

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
pub trait Endpoint {
    /// What the role tells its application: small, owned values.
    type Event;

    /// Takes in received bytes, all of them. `now` is when the last of them had arrived.
    fn handle_input(&mut self, bytes: &[u8], now: Instant);

    /// Lets time pass. Before [`poll_timeout`](Self::poll_timeout) it does nothing.
    fn handle_timeout(&mut self, now: Instant);

    /// The next bytes to send, if any: one frame, handed out once, to be sent from `now` on.
    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]>;

    /// The next event, if any, in the order in which they happened.
    ///
    /// There is room for a fixed number of events. When nobody takes them out, the newest are
    /// refused and counted, and the oldest are kept.
    fn poll_event(&mut self) -> Option<Self::Event>;

    /// When to call [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_transmit`](Self::poll_transmit) again at the latest; `None` if only bytes or commands
    /// can change anything. To be asked anew after any other call.
    fn poll_timeout(&self) -> Option<Instant>;
}
