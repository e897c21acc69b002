//! Turns received bytes into frames, and tracks how old each frame is.

use super::{frame::Frame, framing::Decoder, role::SHORTEST};
use crate::{
    inbox::{self, AfterIdle},
    stream::{Counters, Event, Held},
    time::{Duration, Instant, wire_time},
};

/// The inbox of both roles.
#[derive(Clone, Debug)]
pub(super) struct Inbox {
    decoder: Decoder,
    times: inbox::Inbox,
    /// From when on the newest chunk can have arrived, and its length, bytes.
    newest_since: Instant,
    newest_len: usize,
    /// A chunk before it, and the number of bytes from its first one on.
    between: Times,
    between_len: usize,
    /// The oldest byte that the decoder holds came in with this chunk or a later one.
    oldest: Times,
}

/// Times of a chunk: at which it counts as received, and from which it can have arrived.
type Times = (Instant, Instant);

impl Inbox {
    /// Creates an inbox in which a pause of two byte times plus `margin` cuts off a frame.
    pub(super) fn new(baud: u32, margin: Duration, now: Instant) -> Self {
        let idle = (wire_time(2, baud) + margin).max(SHORTEST);
        let times = inbox::Inbox::new(idle, AfterIdle::GiveUpAll, now);
        let none = (now, now);
        Self {
            decoder: Decoder::new(),
            times,
            newest_since: now,
            newest_len: 0,
            between: none,
            between_len: 0,
            oldest: none,
        }
    }

    /// Announces a chunk of bytes handed in at `now`. Its frames count as received at `at`, and can
    /// have arrived as early as `since`. Then call [`next`](Self::next) with it until that returns
    /// `None`.
    pub(super) const fn receive(
        &mut self,
        chunk: &[u8],
        at: Instant,
        since: Instant,
        now: Instant,
    ) {
        self.times.receive(at, now);
        (self.newest_since, self.newest_len) = (since, chunk.len());
        self.between_len = self.between_len.saturating_add(chunk.len());
    }

    /// Gives up the pending candidate once the line has been idle long enough; returns whether it
    /// did.
    ///
    /// If so, call [`next`](Self::next) without bytes until it returns `None`, and then call this
    /// again.
    pub(super) fn settle(&mut self, now: Instant) -> bool {
        let is_idle = self.times.settle(self.decoder.pending(), now);
        if is_idle {
            self.decoder.idle();
            self.newest_len = 0;
        }
        is_idle
    }

    /// The next frame, the time at which it counts as received, and how early it can have arrived.
    ///
    /// A frame that had arrived completely before the newest chunk was held back by a false header.
    /// It is dated to the oldest byte held, because a command found late is an old command.
    pub(super) fn next(&mut self, bytes: &mut &[u8]) -> Option<(&Frame, Instant, Instant)> {
        loop {
            match self.decoder.advance_buffered(bytes) {
                // The counters already include the gap.
                Some(Held::Gap(_)) => {}
                Some(held) => {
                    let behind = self.decoder.pending() + bytes.len();
                    let is_held_back = behind >= self.newest_len;
                    let (at, early) = if is_held_back { self.oldest } else { self.newest() };
                    return match self.decoder.held_event(held)? {
                        Event::Frame(frame) => Some((frame, at, early)),
                        Event::Skipped(_) => None,
                    };
                }
                None => {
                    if self.newest_len == 0 {
                        return None; // the line is idle
                    }
                    let pending = self.decoder.pending();
                    if pending <= self.newest_len {
                        self.between = self.newest();
                    } else if pending > self.between_len {
                        return None;
                    }
                    self.oldest = self.between;
                    (self.between, self.between_len) = (self.newest(), self.newest_len);
                    return None;
                }
            }
        }
    }

    const fn newest(&self) -> Times {
        (self.times.last(), self.newest_since)
    }

    /// Time at which the line counts as idle, if any byte is pending.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.times.deadline(self.decoder.pending())
    }

    pub(super) const fn counters(&self) -> Counters {
        self.decoder.counters()
    }
}
