//! When received bytes arrived, and when the line is idle: the inbox of every role that waits for
//! the other end to speak first.

use crate::{
    stream::{Decoder, Event, Framing, Held},
    time::{Duration, Instant, reached},
};

/// The times of the bytes that a role's decoder holds.
#[derive(Clone, Debug)]
pub(crate) struct Inbox {
    /// Earliest time at which the newest byte can have arrived.
    last: Instant,
    /// When that byte was handed in: the rest of its frame may come from then on.
    read_at: Instant,
    /// When the oldest byte that the decoder holds had arrived.
    since: Instant,
    /// Length of the newest chunk, bytes.
    chunk_len: usize,
    /// A pause this long cuts a frame off.
    idle: Duration,
    after_idle: AfterIdle,
}

/// What an idle line means for the candidates behind the one that it has ended.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum AfterIdle {
    /// They end with it.
    #[cfg(feature = "ucp")]
    GiveUpAll,
    /// Each may go on for as long again.
    #[cfg(feature = "ikeya")]
    WaitAgain,
}

impl AfterIdle {
    const fn waits_again(self) -> bool {
        match self {
            #[cfg(feature = "ucp")]
            Self::GiveUpAll => false,
            #[cfg(feature = "ikeya")]
            Self::WaitAgain => true,
        }
    }
}

impl Inbox {
    pub(crate) const fn new(idle: Duration, after_idle: AfterIdle, now: Instant) -> Self {
        Self { last: now, read_at: now, since: now, chunk_len: 0, idle, after_idle }
    }

    /// A chunk of bytes is handed in at `now`, and may have arrived at any time from `at` on. Call
    /// [`next`](Self::next) with it until that is `None`.
    pub(crate) const fn receive(&mut self, chunk: &[u8], at: Instant, now: Instant) {
        (self.last, self.read_at, self.chunk_len) = (at, now, chunk.len());
    }

    /// Has the line been idle for so long that nothing will complete the `pending` bytes (ruling B3)?
    ///
    /// If it has, call [`Decoder::idle`] and take the frames that the candidate has held back, and
    /// then ask again.
    pub(crate) fn settle(&mut self, pending: usize, now: Instant) -> bool {
        let is_idle = reached(self.deadline(pending), now);
        if is_idle {
            self.chunk_len = 0;
            if self.after_idle.waits_again() {
                self.read_at = now;
            }
        }
        is_idle
    }

    /// The next frame, and when it had arrived.
    ///
    /// A frame that had arrived whole before the newest chunk was held back by a false header. It is
    /// as old as the first byte that was held, because a command that comes to light late is an old
    /// one.
    #[cfg(feature = "ucp")]
    pub(crate) fn next<'d, F: Framing, const N: usize>(
        &mut self,
        decoder: &'d mut Decoder<F, N>,
        bytes: &mut &[u8],
    ) -> Option<(F::Frame<'d>, Instant)> {
        loop {
            match decoder.advance_buffered(bytes) {
                // A gap is in the counters already.
                Some(Held::Gap(_)) => {}
                Some(held) => {
                    let behind = decoder.pending() + bytes.len();
                    let at = if behind >= self.chunk_len { self.since } else { self.last };
                    return match decoder.held_event(held)? {
                        Event::Frame(frame) => Some((frame, at)),
                        Event::Skipped(_) => None,
                    };
                }
                None => {
                    if decoder.pending() <= self.chunk_len {
                        self.since = self.last;
                    }
                    return None;
                }
            }
        }
    }

    /// When the newest byte had arrived, at the earliest.
    #[cfg(feature = "ikeya")]
    pub(crate) const fn last(&self) -> Instant {
        self.last
    }

    /// When the line counts as idle, if any byte is pending.
    pub(crate) fn deadline(&self, pending: usize) -> Option<Instant> {
        (pending > 0).then(|| self.read_at + self.idle)
    }
}
