//! The motor command: the latest wins, is repeated, and does not outlive its application.

use super::HostConfig;
use crate::{
    endpoint::Unsent,
    time::{Instant, earliest},
    ucp::{MotorControl, role::reached},
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
    /// Frames to be sent one right behind the other: two where the first may be taken for the rest
    /// of a frame that was cut off.
    copies: u8,
    /// The frame that was handed out last was one of them.
    is_copy_out: bool,
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
        Self { latest, sent: None, due, dead_man: None, first, copies: 0, is_copy_out: false }
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
            && self.copies == 0
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
        self.dead_man = (!still).then(|| now + config.command_timeout);
        let earliest = match self.sent {
            // The first frame comes first, and more copies of it if need be.
            _ if self.first == First::Due || self.copies > 0 => now,
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
    pub(super) fn take(&mut self, now: Instant, config: &HostConfig) -> Option<MotorControl> {
        let latest = self.latest.filter(|_| reached(self.due, now))?;
        let command = if self.first == First::Due { latest.halted() } else { latest };
        self.is_copy_out = self.copies > 0;
        self.copies = self.copies.saturating_sub(1);
        self.sent = Some((command, now));
        // What has been waiting behind the first frame goes out right behind it.
        let goes_on = self.copies > 0 || command != latest;
        self.due = Some(if goes_on { now } else { now + config.command_period });
        if self.copies == 0 {
            self.first = match self.first {
                First::Due => First::Out,
                First::Out | First::Followed => First::Followed,
                // Whoever asks for the next round has flushed this one.
                First::Flushing | First::Done => First::Done,
            };
        }
        Some(command)
    }

    /// Everything that was due has been handed out.
    pub(super) fn end_round(&mut self) {
        if matches!(self.first, First::Out | First::Followed) {
            self.first = First::Flushing;
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
        match unsent {
            Unsent::CutOff => self.copies = 2,
            // One that has not left does not count.
            Unsent::Untouched if was_last && self.is_copy_out => self.copies += 1,
            // Nor do both.
            Unsent::Unflushed if self.is_copy_out => self.copies = 2,
            Unsent::Untouched | Unsent::Unflushed => {}
        }
        self.is_copy_out = false;
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
