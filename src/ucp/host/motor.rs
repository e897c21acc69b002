//! The motor command: the latest wins, is repeated, and does not outlive its application.

use super::config::HostConfig;
use crate::{
    endpoint::Unsent,
    time::{Instant, earliest, reached},
    ucp::motor::MotorControl,
};

/// Which motor command is sent when.
#[derive(Clone, Debug)]
pub(super) struct Motor {
    latest: Option<MotorControl>,
    /// What was handed out last, and when; `None` once it is in doubt whether it has left.
    sent: Option<(MotorControl, Instant)>,
    /// When the latest is to be sent.
    due: Option<Instant>,
    /// When the application has been silent for too long; set while the robot moves.
    dead_man: Option<Instant>,
    first: First,
    copies: Copies,
}

/// Motor commands behind a frame that was cut off: two, one right behind the other, because the robot
/// may take the first for the rest of that frame (ruling U16).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Copies {
    /// One frame is enough.
    None,
    /// So many are to be handed out.
    Due(u8),
    /// Both are handed out.
    Out,
    /// Both are handed out, and so was all the rest: the port is flushed now.
    Flushing,
}

impl Copies {
    const BOTH: Self = Self::Due(2);

    const fn are_due(self) -> bool {
        matches!(self, Self::Due(_))
    }

    /// A motor command is handed out.
    const fn take(self) -> Self {
        match self {
            Self::None => Self::None,
            Self::Due(2..) => Self::Due(1),
            Self::Due(_) | Self::Out | Self::Flushing => Self::Out,
        }
    }

    /// A frame did not reach the line. With a flush that failed, all that were handed out since the last
    /// one may be lost; a copy that the port has not touched is due again with the command.
    const fn unsent(self, unsent: Unsent) -> Self {
        match (unsent, self) {
            (Unsent::CutOff, _) => Self::BOTH,
            (_, Self::None) => Self::None,
            (Unsent::Unflushed, _) | (Unsent::Untouched, Self::Due(_)) => Self::BOTH,
            (Unsent::Untouched, _) => self,
        }
    }
}

/// The first frame of a host, which tells the robot to stand still (ruling U16).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum First {
    /// To be sent before anything else.
    Due,
    /// Handed out, and no motor command since.
    Out,
    /// Handed out, and other motor commands behind it before the port could be flushed.
    Followed,
    /// Handed out, and so was all the rest: the port is flushed now.
    Flushing,
    /// Done, or not wanted.
    Done,
}

impl Motor {
    pub(super) const fn new(now: Instant, config: &HostConfig) -> Self {
        let (latest, due, first) = if config.sends_first_stop {
            (Some(MotorControl::STOP), Some(now), First::Due)
        } else {
            (None, None, First::Done)
        };
        Self { latest, sent: None, due, dead_man: None, first, copies: Copies::None }
    }

    /// The latest command, halted by now if the application has gone silent.
    pub(super) const fn latest(&self) -> Option<MotorControl> {
        self.latest
    }

    /// Has the robot been told to stand still, as the latest command says?
    pub(super) fn is_stop_sent(&self) -> bool {
        let stands_still = |command: &MotorControl| command.stands_still();
        self.latest.as_ref().is_some_and(stands_still)
            && self.sent.is_some_and(|(sent, _)| stands_still(&sent))
            && !self.copies.are_due()
    }

    /// May an update begin? The robot has been told to stand still, or this host has told it
    /// nothing at all.
    pub(super) fn allows_update(&self) -> bool {
        self.latest.is_none() || self.is_stop_sent()
    }

    /// Says the latest command once more, at once.
    pub(super) fn repeat(&mut self, now: Instant) {
        self.due = self.latest.map(|_| now);
    }

    pub(super) fn command(&mut self, command: MotorControl, now: Instant, config: &HostConfig) {
        let still = command.stands_still();
        self.latest = Some(command);
        self.dead_man = (!still).then(|| now + config.dead_man);
        let earliest = match self.sent {
            // The first frame comes first, and more copies of it if need be.
            _ if self.first == First::Due || self.copies.are_due() => now,
            // What the robot has been told already can wait for its turn.
            Some((sent, _)) if sent == command && self.due.is_some() => return,
            Some((sent, at)) if !still || sent.stands_still() => now.max(at + config.command_gap),
            _ => now,
        };
        self.due = Some(earliest);
    }

    /// Halts when the application has been silent for too long; says whether that is now.
    pub(super) fn expire(&mut self, now: Instant) -> bool {
        let silent = reached(self.dead_man, now);
        if silent {
            self.dead_man = None;
            self.latest = self.latest.as_ref().map(MotorControl::halted);
            self.due = Some(now);
        }
        silent
    }

    /// The command to send now, if any.
    pub(super) fn take_due(&mut self, now: Instant, config: &HostConfig) -> Option<MotorControl> {
        let latest = self.latest.filter(|_| reached(self.due, now))?;
        let command = if self.first == First::Due { latest.halted() } else { latest };
        self.copies = self.copies.take();
        self.sent = Some((command, now));
        // What has been waiting behind the first frame goes out right behind it.
        let goes_on = self.copies.are_due() || command != latest;
        self.due = Some(if goes_on { now } else { now + config.command_period });
        if !self.copies.are_due() {
            self.first = match self.first {
                First::Due => First::Out,
                First::Out | First::Followed => First::Followed,
                // Whoever asks for the next round has flushed this one.
                First::Flushing | First::Done => First::Done,
            };
        }
        Some(command)
    }

    /// Somebody asks for a frame: whoever had everything before has flushed it.
    pub(super) fn begin_round(&mut self) {
        if self.copies == Copies::Flushing {
            self.copies = Copies::None;
        }
    }

    /// Everything that was due has been handed out.
    pub(super) fn end_round(&mut self) {
        if matches!(self.first, First::Out | First::Followed) {
            self.first = First::Flushing;
        }
        if self.copies == Copies::Out {
            self.copies = Copies::Flushing;
        }
    }

    /// A frame did not reach the line: whatever the robot was told before, it is told the latest
    /// command at once. `was_last` says that the frame was a motor command.
    pub(super) fn unsent(&mut self, unsent: Unsent, was_last: bool, now: Instant) {
        self.sent = None;
        let is_lost = match self.first {
            First::Out | First::Flushing => was_last || unsent == Unsent::Unflushed,
            First::Followed => unsent == Unsent::Unflushed,
            First::Due | First::Done => false,
        };
        if is_lost {
            self.first = First::Due;
        }
        self.copies = self.copies.unsent(unsent);
        // Paused, it stays silent.
        if self.due.is_some() {
            self.due = Some(now);
        }
    }

    /// Sends no more until the next command.
    pub(super) const fn pause(&mut self) {
        self.due = None;
    }

    /// Ends a pause: the latest command is sent again.
    pub(super) fn resume(&mut self, now: Instant) {
        if self.latest.is_some() {
            self.due.get_or_insert(now);
        }
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        earliest(&[self.due, self.dead_man])
    }
}
