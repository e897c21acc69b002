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
    /// Earliest time at which all bytes taken by the port can have left.
    left_at: Instant,
    /// The same time, without a pause inside the frame since the last flush.
    unbroken_at: Instant,
    taken: Taken,
    flush: Flush,
    /// Since when the port has been asked, without success, to take bytes, and to flush them.
    #[cfg(feature = "embedded-io-async")]
    pub(super) write_wait: Wait,
    #[cfg(feature = "embedded-io-async")]
    pub(super) flush_wait: Wait,
}

/// How the port has taken the frame.
///
/// When the bytes of a part are on the line is not known: a port may send them at once, or hold
/// them until its flush. But no byte leaves before its write begins, and all have left after a
/// flush. So no pause inside the frame is longer than the time from its first write to its flush,
/// less its time on the line.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Taken {
    /// Nothing of it.
    Nothing,
    /// A part, or all of it in parts: only a flush in time shows that it did not pause too long.
    Parts,
    /// A part, and the rest was given up: a flush shows when that part has left.
    CutOff,
    /// All of it at once, or all of it has left.
    Whole,
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

    /// Notes that the port has done it, has failed, or was not asked for long.
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
    pub(super) const fn new(now: Instant) -> Self {
        Self {
            outbox: Outbox::new(),
            asked_at: now,
            left_at: now,
            unbroken_at: now,
            taken: Taken::Nothing,
            // A driver before this one may have left bytes in the port, and its pin on.
            flush: Flush::Failed,
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
        self.taken = Taken::Nothing;
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
        self.left_at = self.left_at.max(self.asked_at);
        if self.taken == Taken::Nothing {
            self.unbroken_at = self.left_at;
            self.taken = if self.outbox.is_empty() { Taken::Whole } else { Taken::Parts };
        }
        self.left_at += wire_time;
        self.unbroken_at += wire_time;
        self.give_up_late(now, silence)
    }

    /// Whether the port is to be flushed before it is asked to take more.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.outbox.is_empty() && matches!(self.taken, Taken::Parts | Taken::CutOff)
    }

    /// Whether the port has taken a part of the frame.
    pub(super) fn is_in_parts(&self) -> bool {
        self.taken == Taken::Parts
    }

    /// Whether the frame is not yet known to have left, or to be given up.
    fn is_under_way(&self) -> bool {
        !self.outbox.is_empty() || self.taken == Taken::Parts
    }

    /// Whether the port is still to take a part of the frame, or to be flushed behind its parts.
    pub(super) fn is_pending(&self) -> bool {
        !self.outbox.is_empty() || self.is_in_doubt()
    }

    /// Gives up a frame that is no longer worth sending: one of which nothing has left, or that was
    /// cut off too long ago. The role then decides again.
    pub(super) fn reclaim(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        match self.taken {
            Taken::Parts => self.give_up_late(now, silence),
            _ => self.give_up(),
        }
    }

    /// Until when a frame in parts has not paused for too long.
    pub(super) fn whole_by(&self, silence: Duration) -> Option<Instant> {
        self.is_in_parts().then_some(self.unbroken_at + silence)
    }

    /// Gives up a frame in parts that has paused for too long, or may have.
    fn give_up_late(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        let is_late = self.whole_by(silence).is_some_and(|by| now > by);
        if is_late { self.give_up() } else { None }
    }

    /// Gives up the frame.
    pub(super) fn give_up(&mut self) -> Option<Unsent> {
        if !self.is_under_way() {
            return None;
        }
        self.outbox.discard();
        self.left_at = self.left_at.min(self.asked_at);
        let (taken, unsent) = match self.taken {
            Taken::Nothing => (Taken::Whole, Unsent::Untouched),
            _ => (Taken::CutOff, Unsent::CutOff),
        };
        self.taken = taken;
        Some(unsent)
    }

    /// Forgets for how long the port has been asked in vain to take bytes.
    pub(super) fn end_write_wait(&mut self) {
        #[cfg(feature = "embedded-io-async")]
        self.write_wait.end();
    }

    /// The same, and for how long to flush them.
    pub(super) fn end_waits(&mut self) {
        self.end_write_wait();
        #[cfg(feature = "embedded-io-async")]
        self.flush_wait.end();
    }

    /// Whether a flush is due; after a failed one, it is due again.
    pub(super) fn needs_flush(&self) -> bool {
        self.flush != Flush::Done
    }

    /// The same, unless the last one failed.
    pub(super) fn is_flush_due(&self) -> bool {
        self.flush == Flush::Due
    }

    /// Notes that everything taken has left. Gives up a frame in parts, unless it cannot have
    /// paused for too long.
    pub(super) fn flushed(&mut self, now: Instant, silence: Duration) -> Option<Unsent> {
        self.flush = Flush::Done;
        let given_up = self.give_up_late(now, silence);
        if self.is_in_doubt() {
            self.taken = Taken::Whole;
        }
        if self.outbox.is_empty() {
            self.left_at = self.left_at.min(now);
        }
        self.unbroken_at = self.left_at;
        given_up
    }

    /// Notes that the port, perhaps another one, is to be flushed.
    pub(super) const fn ask_flush(&mut self) {
        self.flush = Flush::Due;
    }

    /// Notes that a flush failed, or will not be made; returns whether the role does not know that
    /// yet.
    ///
    /// The port may hold a part of a frame for the next flush, so that is tried before the port is
    /// asked to take more. A port that cannot be flushed at all must still be sent stops, so it is
    /// tried only once.
    pub(super) fn flush_failed(&mut self) -> Option<Unsent> {
        // The port may hold nothing any more.
        self.left_at = self.left_at.min(self.asked_at);
        let is_news = self.flush == Flush::Due;
        if self.is_in_doubt() && !is_news {
            self.taken = Taken::Whole;
        }
        if is_news {
            self.flush = Flush::Failed;
        }
        is_news.then_some(Unsent::Unflushed)
    }
}
