//! Received bytes, made frames of, and how old each frame is.

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
    /// When the oldest byte that the decoder holds had arrived.
    since: Instant,
    /// Length of the newest chunk, bytes.
    chunk_len: usize,
}

impl Inbox {
    /// An inbox in which a pause of two byte times and `margin` cuts a frame off.
    pub(super) fn new(baud: u32, margin: Duration, now: Instant) -> Self {
        let idle = (wire_time(2, baud) + margin).max(SHORTEST);
        let times = inbox::Inbox::new(idle, AfterIdle::GiveUpAll, now);
        Self { decoder: Decoder::new(), times, since: now, chunk_len: 0 }
    }

    /// A chunk of bytes is handed in at `now`, and may have arrived at any time from `at` on. Call
    /// [`next`](Self::next) with it until that is `None`.
    pub(super) const fn receive(&mut self, chunk: &[u8], at: Instant, now: Instant) {
        self.times.receive(at, now);
        self.chunk_len = chunk.len();
    }

    /// Gives up the pending candidate if the line has been idle for so long that nothing will
    /// complete it, and says whether that is so.
    ///
    /// If it is, call [`next`](Self::next) without bytes until that is `None`, and then ask again.
    pub(super) fn settle(&mut self, now: Instant) -> bool {
        let is_idle = self.times.settle(self.decoder.pending(), now);
        if is_idle {
            self.decoder.idle();
            self.chunk_len = 0;
        }
        is_idle
    }

    /// The next frame, and when it had arrived.
    ///
    /// A frame that had arrived whole before the newest chunk was held back by a false header. It is
    /// as old as the first byte that was held, because a command that comes to light late is an old
    /// one.
    pub(super) fn next(&mut self, bytes: &mut &[u8]) -> Option<(&Frame, Instant)> {
        loop {
            match self.decoder.advance_buffered(bytes) {
                // A gap is in the counters already.
                Some(Held::Gap(_)) => {}
                Some(held) => {
                    let behind = self.decoder.pending() + bytes.len();
                    let is_held_back = behind >= self.chunk_len;
                    let at = if is_held_back { self.since } else { self.times.last() };
                    return match self.decoder.held_event(held)? {
                        Event::Frame(frame) => Some((frame, at)),
                        Event::Skipped(_) => None,
                    };
                }
                None => {
                    if self.decoder.pending() <= self.chunk_len {
                        self.since = self.times.last();
                    }
                    return None;
                }
            }
        }
    }

    /// When the line counts as idle, if any byte is pending.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.times.deadline(self.decoder.pending())
    }

    pub(super) const fn counters(&self) -> Counters {
        self.decoder.counters()
    }
}
