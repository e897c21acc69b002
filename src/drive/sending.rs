//! The frame that is being sent, and whether it is still worth sending.

use super::error::DriveError;
use crate::{
    endpoint::Unsent,
    outbox::Outbox,
    time::{Duration, Instant},
};

/// Longest frame of any role, bytes.
pub(super) const FRAME_LEN: usize = 64;

/// What is left of a frame.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    outbox: Outbox<FRAME_LEN>,
    /// When the latest write began.
    asked_at: Instant,
    /// The frame, if a byte of it has left.
    begun: Option<Begun>,
    flush: Flush,
    /// Since when the port has been asked without success to take bytes, and to flush them.
    #[cfg(feature = "embedded-io-async")]
    pub(super) write_wait: Wait,
    #[cfg(feature = "embedded-io-async")]
    pub(super) flush_wait: Wait,
}

/// How a frame leaves that a port takes in parts.
///
/// When its bytes are on the line is not known: a write may come back before they are out, or long
/// after. But no byte leaves before its write has begun, and the bytes of a write that has come back
/// are on their way, so the longest possible pause in front of them is known. And no pause is longer
/// than what a frame has taken, from its first write to its flush, beyond its time on the line.
#[derive(Clone, Copy, Debug)]
struct Begun {
    /// The bytes that the port has taken have not all left before.
    left_at: Instant,
    /// The same had there been no pause and no wait at all.
    unbroken_at: Instant,
    /// A pause may have been too long.
    is_doubtful: bool,
}

/// Since when a port has been asked for something, in calls that were dropped as well.
#[cfg(feature = "embedded-io-async")]
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait(Option<Instant>);

#[cfg(feature = "embedded-io-async")]
impl Wait {
    /// The port is asked, for the first time or again: says how long ago the first time was.
    pub(super) fn begin(&mut self, now: Instant) -> Duration {
        now - *self.0.get_or_insert(now)
    }

    /// The port has done it, or has failed.
    pub(super) fn end(&mut self) {
        self.0 = None;
    }
}

/// What the port may still hold.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Flush {
    /// Nothing.
    Done,
    /// Bytes written since the last flush.
    Due,
    /// As before, and the role knows that they may be lost.
    Failed,
}

impl Sending {
    pub(super) const fn new() -> Self {
        let asked_at = Instant::from_micros(0);
        Self {
            outbox: Outbox::new(),
            asked_at,
            begun: None,
            flush: Flush::Done,
            #[cfg(feature = "embedded-io-async")]
            write_wait: Wait(None),
            #[cfg(feature = "embedded-io-async")]
            flush_wait: Wait(None),
        }
    }

    /// Bytes that the port has not taken yet.
    pub(super) fn rest(&self) -> &[u8] {
        self.outbox.unsent()
    }

    /// Takes in the next frame.
    pub(super) fn load<E>(&mut self, frame: &[u8]) -> Result<(), DriveError<E>> {
        let (length, limit) = (frame.len(), FRAME_LEN);
        self.outbox.extend(frame).ok_or(DriveError::FrameTooLong { length, limit })?;
        self.begun = None;
        Ok(())
    }

    /// The port is to take the rest. Even if it takes nothing, it may have switched its driver on.
    pub(super) fn begin_write(&mut self, now: Instant) {
        (self.asked_at, self.flush) = (now, Flush::Due);
    }

    /// The port has taken `count` bytes, which take `wire_time` on the line. Gives up the frame if
    /// they came after too long a silence: the other end no longer takes them for its rest.
    pub(super) fn sent(
        &mut self,
        count: usize,
        wire_time: Duration,
        now: Instant,
        silence: Duration,
    ) -> Option<Unsent> {
        self.outbox.taken(count);
        self.flush = Flush::Due;
        let asked_at = self.asked_at;
        let before = self.begun.unwrap_or(Begun {
            left_at: asked_at,
            unbroken_at: asked_at,
            is_doubtful: false,
        });
        let is_first = self.begun.is_none();
        let frame = Begun {
            left_at: before.left_at.max(asked_at) + wire_time,
            unbroken_at: before.unbroken_at + wire_time,
            is_doubtful: before.is_doubtful || !is_first && now > before.left_at + silence,
        };
        self.begun = Some(frame);
        // Its flush cannot be in time any more.
        let is_cut_off = frame.is_doubtful && now > frame.unbroken_at + silence;
        if is_cut_off { self.give_up() } else { None }
    }

    /// Has all of a frame been taken, and only a flush in time shows that it had no pause?
    pub(super) fn is_in_doubt(&self) -> bool {
        self.outbox.is_empty() && self.begun.is_some_and(|frame| frame.is_doubtful)
    }

    /// Gives up what is no longer worth sending, for the role to decide anew: a frame of which
    /// nothing has left, and one that was cut off too long ago.
    pub(super) fn reclaim(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        match self.begun {
            Some(frame) if !self.outbox.is_empty() && now <= frame.left_at + silence => None,
            _ => self.give_up(),
        }
    }

    /// Gives up the frame.
    pub(super) fn give_up(&mut self) -> Option<Unsent> {
        if self.outbox.is_empty() && !self.is_in_doubt() {
            return None;
        }
        self.outbox.discard();
        Some(self.begun.take().map_or(Unsent::Untouched, |_| Unsent::CutOff))
    }

    /// Is a flush due? Again and again after one that failed.
    pub(super) fn needs_flush(&self) -> bool {
        self.flush != Flush::Done
    }

    /// Everything has left. Gives up a frame in doubt, unless it cannot have paused for too long.
    pub(super) fn flushed(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        self.flush = Flush::Done;
        let frame = self.begun.filter(|_| self.is_in_doubt())?;
        if now > frame.unbroken_at + silence {
            return self.give_up();
        }
        self.begun = None;
        None
    }

    /// A flush has failed, or will not be made; says whether the role does not know that yet.
    pub(super) fn flush_failed(&mut self) -> Option<Unsent> {
        let is_news = self.flush == Flush::Due;
        if is_news {
            self.flush = Flush::Failed;
        }
        is_news.then_some(Unsent::Unflushed)
    }
}
