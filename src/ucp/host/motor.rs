//! The motor command: the latest wins, is repeated, and does not outlive its application.

use super::{
    config::HostConfig,
    standstill::{Standstill, StopProgress},
};
use crate::{
    endpoint::Unsent,
    time::{Instant, earliest, reached},
    ucp::motor::MotorControl,
};

/// Decides which motor command is sent, and when.
#[derive(Clone, Debug)]
pub(super) struct Motor {
    latest: Option<MotorControl>,
    /// The command handed out last, and when; `None` if it may not have left.
    sent: Option<(MotorControl, Instant)>,
    /// A stop was asked for since.
    is_stop_new: bool,
    /// Time at which the latest command is to be sent.
    due: Option<Instant>,
    /// Time at which the application has been silent for too long; set while the robot moves.
    dead_man: Option<Instant>,
    first: First,
    copies: Copies,
    stop: Stop,
    standstill: Standstill,
}

/// How far the stop handed out last has got, until one has been flushed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Stop {
    /// Handed out.
    Out,
    /// The port has taken all of it, and will tell when it has been flushed.
    Taken,
    /// Handed out, and so have all other frames: the port is being flushed.
    Flushing,
    /// Flushed, or there is none.
    Done,
}

/// Motor commands after a frame that was cut off, as one may have been whose flush failed: two, the
/// second right behind the first, because the robot may take the first for the rest of that frame
/// (ruling U16).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Copies {
    /// One frame is enough.
    None,
    /// This many are still to be handed out.
    Due(u8),
    /// Both have been handed out.
    Out,
    /// Both have been handed out, and so have all other frames: the port is being flushed.
    Flushing,
}

impl Copies {
    const BOTH: Self = Self::Due(2);

    const fn are_due(self) -> bool {
        matches!(self, Self::Due(_))
    }

    /// Counts a motor command that is handed out.
    const fn take(self) -> Self {
        match self {
            Self::None => Self::None,
            Self::Due(2..) => Self::Due(1),
            Self::Due(_) | Self::Out | Self::Flushing => Self::Out,
        }
    }

    /// Handles a frame that did not reach the line. A failed flush may have lost any part of what
    /// was handed out since the last one, the end of a frame included; a copy that the port has not
    /// touched is due again with the command.
    const fn unsent(self, unsent: Unsent) -> Self {
        match (unsent, self) {
            (Unsent::CutOff | Unsent::Unflushed, _) | (Unsent::Untouched, Self::Due(_)) => {
                Self::BOTH
            }
            (Unsent::Untouched, _) => self,
        }
    }
}

/// The first frame of a host, which tells the robot to stand still (ruling U16).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum First {
    /// To be sent before anything else.
    Due,
    /// Handed out.
    Out {
        /// Other motor commands have been handed out behind it.
        is_followed: bool,
        /// The port has taken all of it, and will tell when it has been flushed.
        is_taken: bool,
    },
    /// Handed out, and so have all other frames: the port is being flushed.
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
        Self {
            latest,
            sent: None,
            is_stop_new: false,
            due,
            dead_man: None,
            first,
            copies: Copies::None,
            stop: Stop::Done,
            standstill: Standstill::Untold,
        }
    }

    /// The latest command, already halted if the application has gone silent.
    pub(super) const fn latest(&self) -> Option<MotorControl> {
        self.latest
    }

    /// Whether the latest command is to stand still, and the robot has been told so.
    pub(super) fn is_stop_sent(&self) -> bool {
        let stands_still = |command: &MotorControl| command.stands_still();
        self.latest.as_ref().is_some_and(stands_still)
            && self.sent.as_ref().is_some_and(|(sent, _)| stands_still(sent))
            && !self.is_stop_new
            && !self.copies.are_due()
    }

    /// Progress of the latest stop, whoever asked for it.
    pub(super) fn stop_progress(&self) -> StopProgress {
        match &self.latest {
            Some(latest) if latest.stands_still() => self.standstill.progress(),
            _ => StopProgress::NotAsked,
        }
    }

    /// The watch over a stop, to take in reports.
    pub(super) const fn standstill(&mut self) -> &mut Standstill {
        &mut self.standstill
    }

    /// Repeats the latest command at once, twice: what the robot was sent before may have left it
    /// with a false length, which swallows stops (ruling U16).
    pub(super) fn repeat(&mut self, now: Instant) {
        self.due = self.latest.map(|_| now);
        if self.due.is_some() {
            self.copies = Copies::BOTH;
        }
    }

    /// Stops: joins the stop before, but is sent as well. If that one was obeyed, the robot may
    /// have been moved since.
    pub(super) fn stop(&mut self, now: Instant, config: &HostConfig) {
        if self.standstill.progress() == StopProgress::StandingStill {
            self.expect_stop();
        }
        self.is_stop_new = true;
        self.take(self.latest.map_or(MotorControl::STOP, |latest| latest.halted()), now, config);
    }

    pub(super) fn command(&mut self, command: MotorControl, now: Instant, config: &HostConfig) {
        if !command.stands_still() {
            self.expect_stop();
        }
        self.is_stop_new = false;
        self.take(command, now, config);
    }

    fn take(&mut self, command: MotorControl, now: Instant, config: &HostConfig) {
        let still = command.stands_still();
        self.latest = Some(command);
        if still {
            self.copy_stop();
        }
        self.dead_man = (!still).then(|| now + config.dead_man);
        let earliest = match self.sent {
            // The first frame takes precedence, and so do its copies.
            _ if self.first == First::Due || self.copies.are_due() => now,
            // A command that the robot already has can wait for its turn.
            Some((sent, _)) if sent == command && !self.is_stop_new && self.due.is_some() => return,
            Some((_, at)) if !still => now.max(at + config.command_gap),
            // A repetition that is due earlier is not put off.
            Some((sent, at)) if sent.stands_still() => {
                let at = now.max(at + config.command_gap);
                self.due.map_or(at, |due| due.min(at))
            }
            _ => now,
        };
        self.due = Some(earliest);
    }

    /// Halts when the application has been silent for too long; returns whether that happened now.
    pub(super) fn expire(&mut self, now: Instant) -> bool {
        self.standstill.expire(now);
        let silent = reached(self.dead_man, now);
        if silent {
            self.halt(now);
        }
        silent
    }

    /// Halts when the robot is no longer heard.
    pub(super) fn lose_link(&mut self, now: Instant) {
        // It moves only under a dead-man.
        if self.dead_man.is_some() {
            self.halt(now);
        }
    }

    fn halt(&mut self, now: Instant) {
        self.dead_man = None;
        self.latest = self.latest.as_ref().map(MotorControl::halted);
        self.copy_stop();
        self.due = Some(now);
    }

    /// Both copies are of the stop, if the first was of a command to move.
    fn copy_stop(&mut self) {
        if self.copies.are_due() && self.sent.as_ref().is_some_and(|(sent, _)| !sent.stands_still())
        {
            self.copies = Copies::BOTH;
        }
    }

    /// None of the motor commands so far is a stop that has left.
    fn expect_stop(&mut self) {
        (self.stop, self.standstill) = (Stop::Done, Standstill::Untold);
    }

    /// The command to send now, if any.
    pub(super) fn take_due(&mut self, now: Instant, config: &HostConfig) -> Option<MotorControl> {
        let latest = self.latest.filter(|_| reached(self.due, now))?;
        let command = if self.first == First::Due { latest.halted() } else { latest };
        self.copies = self.copies.take();
        (self.sent, self.is_stop_new) = (Some((command, now)), false);
        // A repetition tells nothing new.
        if latest.stands_still() && self.standstill.is_untold() {
            self.stop = Stop::Out;
        }
        // A command that waits behind the first frame is sent right after it.
        let goes_on = self.copies.are_due() || command != latest;
        self.due = Some(if goes_on { now } else { now + config.command_period });
        if !self.copies.are_due() {
            self.first = match self.first {
                First::Due => First::Out { is_followed: false, is_taken: false },
                First::Out { is_taken, .. } => First::Out { is_followed: true, is_taken },
                // A request for the next round shows that this one has been flushed.
                First::Flushing | First::Done => First::Done,
            };
        }
        Some(command)
    }

    /// Begins a round: a request for a frame shows that the previous round has been flushed.
    pub(super) fn begin_round(&mut self, now: Instant) {
        if self.copies == Copies::Flushing {
            self.copies = Copies::None;
        }
        if self.stop == Stop::Flushing {
            self.left(now);
        }
    }

    /// Ends a round: everything that was due has been handed out.
    pub(super) fn end_round(&mut self) {
        if matches!(self.first, First::Out { is_taken: false, .. }) {
            self.first = First::Flushing;
        }
        if self.copies == Copies::Out {
            self.copies = Copies::Flushing;
        }
        if self.stop == Stop::Out {
            self.stop = Stop::Flushing;
        }
    }

    /// The port has taken all of the last frame, a motor command.
    pub(super) fn taken(&mut self) {
        if let First::Out { is_followed: false, is_taken } = &mut self.first {
            *is_taken = true;
        }
        if self.stop == Stop::Out {
            self.stop = Stop::Taken;
        }
    }

    /// All that the port has taken has left.
    pub(super) fn flushed(&mut self, now: Instant) {
        if matches!(self.first, First::Out { is_taken: true, .. }) {
            self.first = First::Done;
        }
        if self.stop == Stop::Taken {
            self.left(now);
        }
    }

    /// The last stop has left, and so has all before it.
    fn left(&mut self, now: Instant) {
        self.stop = Stop::Done;
        if self.is_stop_sent() {
            self.standstill.tell(now);
        }
    }

    /// Handles a frame that did not reach the line: whatever the robot was told before, the latest
    /// command is due at once. `was_last` means that the frame was a motor command.
    pub(super) fn unsent(&mut self, unsent: Unsent, was_last: bool, now: Instant) {
        self.sent = None;
        self.expect_stop();
        let is_lost = match self.first {
            First::Flushing | First::Out { is_followed: false, .. } => {
                was_last || unsent == Unsent::Unflushed
            }
            First::Out { is_followed: true, .. } => unsent == Unsent::Unflushed,
            First::Due | First::Done => false,
        };
        if is_lost {
            self.first = First::Due;
        }
        self.copies = self.copies.unsent(unsent);
        // A paused motor stays silent.
        if self.due.is_some() {
            self.due = Some(now);
        }
    }

    /// Sends no more commands until the next call.
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
