//! The frame being sent, and whether it is still worth sending.

use super::error::DriveError;
use crate::{
    endpoint::Unsent,
    outbox::Outbox,
    time::{Duration, Instant},
};

/// Length of the longest frame of any role, bytes.
pub(super) const FRAME_LEN: usize = 64;

/// The unsent rest of a frame.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    outbox: Outbox<FRAME_LEN>,
    /// Start of the latest write.
    asked_at: Instant,
    /// The frame, if any byte of it has left.
    begun: Option<Begun>,
    flush: Flush,
    /// Since when the port has been asked, without success, to take bytes, and to flush them.
    #[cfg(feature = "embedded-io-async")]
    pub(super) write_wait: Wait,
    #[cfg(feature = "embedded-io-async")]
    pub(super) flush_wait: Wait,
}

/// Timing of a frame that a port takes in parts.
///
/// When its bytes are on the line is not known: a write may return before they are out, or long
/// after. But no byte leaves before its write begins, and when the write returns, its bytes are on
/// their way. So the longest possible pause in front of them is known. And no pause is longer than
/// the time from the first write of the frame to its flush, less its time on the line.
#[derive(Clone, Copy, Debug)]
struct Begun {
    /// Earliest time at which all bytes taken by the port can have left.
    left_at: Instant,
    /// The same time, without any pause or wait since the last flush.
    unbroken_at: Instant,
    /// Whether a pause may have been too long.
    is_doubtful: bool,
}

/// Since when a port has been asked for something, including calls that were dropped.
#[cfg(feature = "embedded-io-async")]
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait(Option<Instant>);

#[cfg(feature = "embedded-io-async")]
impl Wait {
    /// Notes a request to the port, the first or a repeated one; returns the time since the first.
    pub(super) fn begin(&mut self, now: Instant) -> Duration {
        now - *self.0.get_or_insert(now)
    }

    /// Notes that the port has done it, or has failed.
    pub(super) fn end(&mut self) {
        self.0 = None;
    }
}

/// What the port may still hold.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Flush {
    /// Nothing.
    Done,
    /// Bytes that it has been asked to take since the last flush, perhaps in a call that was
    /// dropped.
    Due,
    /// The same, and the role knows that they may be lost.
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

    /// Loads the next frame.
    pub(super) fn load<E>(&mut self, frame: &[u8]) -> Result<(), DriveError<E>> {
        let (length, limit) = (frame.len(), FRAME_LEN);
        self.outbox.extend(frame).ok_or(DriveError::FrameTooLong { length, limit })?;
        self.begun = None;
        Ok(())
    }

    /// Notes that the port is asked to take the rest. Even if it takes nothing, it may have
    /// switched its driver on.
    pub(super) fn begin_write(&mut self, now: Instant) {
        (self.asked_at, self.flush) = (now, Flush::Due);
    }

    /// Notes that the port has taken `count` bytes, which take `wire_time` on the line. Gives up
    /// the frame if they came after too long a silence: the other end no longer takes them as its
    /// rest.
    pub(super) fn sent(
        &mut self,
        count: usize,
        wire_time: Duration,
        now: Instant,
        silence: Duration,
    ) -> Option<Unsent> {
        self.outbox.taken(count);
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
        // Its flush can no longer be in time.
        let is_cut_off = frame.is_doubtful && now > frame.unbroken_at + silence;
        if is_cut_off { self.give_up() } else { None }
    }

    /// Whether all of a frame was taken, but only a flush in time can show that it did not pause.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.outbox.is_empty() && self.begun.is_some_and(|frame| frame.is_doubtful)
    }

    /// Gives up a frame that is no longer worth sending: one of which nothing has left, or that was
    /// cut off too long ago. The role then decides again.
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

    /// Whether a flush is due; after a failed one, it is due again.
    pub(super) fn needs_flush(&self) -> bool {
        self.flush != Flush::Done
    }

    /// Notes that everything taken has left. Gives up a frame in doubt, unless it cannot have
    /// paused for too long.
    pub(super) fn flushed(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        self.flush = Flush::Done;
        let is_whole = self.outbox.is_empty();
        let frame = self.begun.as_mut()?;
        if frame.is_doubtful && now > frame.unbroken_at + silence {
            return self.give_up();
        }
        if !is_whole {
            // What has left did not pause; the rest may wait for the next flush.
            (frame.unbroken_at, frame.is_doubtful) = (frame.left_at, true);
        } else if frame.is_doubtful {
            self.begun = None;
        }
        None
    }

    /// Notes that a flush failed, or will not be made; returns whether the role does not know that
    /// yet.
    pub(super) fn flush_failed(&mut self) -> Option<Unsent> {
        let is_news = self.flush == Flush::Due;
        if is_news {
            self.flush = Flush::Failed;
        }
        is_news.then_some(Unsent::Unflushed)
    }
}
