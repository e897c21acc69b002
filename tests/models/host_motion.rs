//! The account of a host's motor commands: what may be sent, and what must be sent (U10, U16).

use axlewire::ucp::message::RawMotorControl;

use super::names::*;

/// The first frame of a host (ruling U16).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Greeting {
    Due,
    /// The port has it.
    Handed,
    /// Flushed, and no motor command since.
    Flushed,
    /// In doubt again although it was flushed: it may be sent again.
    May,
    Done,
}

/// How far the latest stop has got.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Stop {
    No,
    Handed,
    /// Flushed, which the host learns when it is next asked for a frame.
    Flushed,
    /// Known to have left since then.
    Left(Instant),
}

#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// The motion wanted of the robot: the latest call, halted 500 ms after it.
    pub(crate) wanted: Option<MotorControl>,
    pub(crate) dead_man: Option<Instant>,
    /// The content of the last motor frame, unless it is in doubt.
    told: Option<MotorControl>,
    /// There was a call since.
    pub(crate) is_called: bool,
    gap_until: Instant,
    repeat_at: Instant,
    /// Number of motor frames sent of the two after a cut-off frame or a failed flush, until both
    /// are flushed.
    behind_cut: Option<u8>,
    /// The last frame of any kind was a motor frame.
    is_motor_last: bool,
    greeting: Greeting,
    /// The last frame handed out is the very first one.
    is_greeting_last: bool,
    stop: Stop,
    /// The application has asked for a stop since the last motor frame.
    is_stop_new: bool,
}

impl Motion {
    pub(crate) fn new(sends_first_stop: bool, now: Instant) -> Self {
        Self {
            wanted: sends_first_stop.then_some(MotorControl::STOP),
            dead_man: None,
            told: None,
            is_called: false,
            gap_until: now,
            repeat_at: now,
            behind_cut: None,
            is_motor_last: false,
            greeting: if sends_first_stop { Greeting::Due } else { Greeting::Done },
            is_greeting_last: false,
            stop: Stop::No,
            is_stop_new: false,
        }
    }

    pub(crate) fn call(&mut self, command: MotorControl, now: Instant) {
        self.is_stop_new = false;
        if !command.stands_still() {
            self.stop = Stop::No;
        }
        (self.wanted, self.is_called) = (Some(command), true);
        self.owe_two_stops();
        self.dead_man = (!command.stands_still()).then(|| now + ms(500));
    }

    pub(crate) fn stop(&mut self, now: Instant) {
        self.call(self.wanted.map_or(MotorControl::STOP, halted), now);
        self.is_stop_new = true;
    }

    /// The application has been silent for 500 ms; returns whether that is new.
    pub(crate) fn expire(&mut self, now: Instant) -> bool {
        let is_silent = self.dead_man.is_some_and(|at| at <= now);
        if is_silent {
            self.halt();
        }
        is_silent
    }

    /// The application is silent, or the robot is no longer heard.
    pub(crate) fn halt(&mut self) {
        (self.wanted, self.dead_man) = (self.wanted.map(halted), None);
        self.owe_two_stops();
    }

    /// Both copies are of the stop, if the first was of a command to move.
    fn owe_two_stops(&mut self) {
        let is_stop = self.wanted.is_some_and(|wanted| wanted.stands_still());
        let has_moved = self.told.is_some_and(|told| !told.stands_still());
        if self.owes_copies() && is_stop && has_moved {
            self.behind_cut = Some(0);
        }
    }

    /// The latest time for the next motor frame.
    pub(crate) fn due(&self, now: Instant) -> Option<Instant> {
        let wanted = self.wanted?;
        let Some(told) = self.told else { return Some(now) };
        Some(match () {
            () if self.owes_copies() || self.greeting == Greeting::Due => now,
            () if self.is_stop_new && told.stands_still() => self.gap_until.min(self.repeat_at),
            () if told == wanted => self.repeat_at,
            () if wanted.stands_still() && !told.stands_still() => now,
            () => self.gap_until,
        })
    }

    pub(crate) fn is_due(&self, now: Instant) -> bool {
        self.due(now).is_some_and(|at| at <= now)
    }

    /// Whether the robot has been told to stop, and nothing else since.
    pub(crate) fn is_stop_sent(&self) -> bool {
        let stands_still =
            |command: Option<MotorControl>| command.is_some_and(|it| it.stands_still());
        let is_handed_out = stands_still(self.told) && !self.is_stop_new;
        stands_still(self.wanted) && is_handed_out && !self.owes_copies()
    }

    /// The host is asked for a frame, and so learns that the port has been flushed.
    pub(crate) fn asked(&mut self, now: Instant) {
        if self.stop == Stop::Flushed {
            // Another stop that was asked for meanwhile has yet to leave.
            self.stop = if self.is_stop_sent() { Stop::Left(now) } else { Stop::No };
        }
    }

    /// Two stops precede the request of an update.
    pub(crate) fn owe_two(&mut self) {
        self.behind_cut = Some(0);
    }

    fn owes_copies(&self) -> bool {
        self.behind_cut.is_some_and(|out| out < 2)
    }

    /// A motor frame is sent.
    pub(crate) fn frame(&mut self, sent: &RawMotorControl, now: Instant) -> Checked {
        let Some(wanted) = self.wanted else {
            return Err("a motor frame that was not requested".into());
        };
        if self.dead_man.is_some_and(|at| at <= now) {
            return Err("a motor frame 500 ms after the last call".into());
        }
        let is_zero = *sent == RawMotorControl::from(halted(wanted));
        let has_to_be_zero = self.greeting == Greeting::Due;
        // One zero command more than needed is harmless.
        let is_extra = matches!(self.greeting, Greeting::Handed | Greeting::May) && is_zero;
        let is_wanted = *sent == RawMotorControl::from(wanted);
        if has_to_be_zero && !is_zero || !has_to_be_zero && !is_wanted && !is_extra {
            return Err(format!("sent {sent:?} instead of {wanted:?}, first: {has_to_be_zero}"));
        }
        if !(self.is_called || self.told != self.wanted || self.is_due(now)) {
            return Err("a motor frame without a reason".into());
        }
        self.told = Some(if is_zero { halted(wanted) } else { wanted });
        self.is_stop_new = false;
        self.is_motor_last = true;
        self.behind_cut = self.behind_cut.map(|out| (out + 1).min(2));
        (self.gap_until, self.repeat_at) = (now + ms(20), now + ms(100));
        self.is_greeting_last = false;
        if self.is_stop_sent() && !matches!(self.stop, Stop::Left(_)) {
            self.stop = Stop::Handed;
        }
        if !self.owes_copies() {
            if self.greeting == Greeting::Due {
                (self.greeting, self.is_greeting_last) = (Greeting::Handed, true);
            } else if self.greeting == Greeting::Flushed {
                self.greeting = Greeting::Done;
            }
            // A command that waited for the first frame is sent right after it.
            self.is_called &= self.told != self.wanted;
        }
        Ok(())
    }

    /// Some other frame is sent.
    pub(crate) const fn other_frame(&mut self) {
        (self.is_greeting_last, self.is_motor_last) = (false, false);
    }

    pub(crate) fn flushed(&mut self) {
        if self.stop == Stop::Handed {
            self.stop = Stop::Flushed;
        }
        if matches!(self.greeting, Greeting::Handed | Greeting::May) {
            self.greeting = Greeting::Flushed;
        }
        self.behind_cut = self.behind_cut.filter(|&out| out < 2);
    }

    /// Whatever the robot was told before is sent again, twice after half a frame or a failed flush
    /// (U16).
    pub(crate) fn unsent(&mut self, unsent: Unsent) {
        (self.told, self.stop) = (None, Stop::No);
        self.greeting = match (self.greeting, unsent) {
            (Greeting::Handed, Unsent::Unflushed) => Greeting::Due,
            (Greeting::Handed, _) if self.is_greeting_last => Greeting::Due,
            (Greeting::Flushed, _) => Greeting::May,
            (as_before, _) => as_before,
        };
        self.behind_cut = match (unsent, self.behind_cut) {
            (Unsent::CutOff | Unsent::Unflushed, _) => Some(0),
            (Unsent::Untouched, Some(out)) if self.is_motor_last => Some(out.saturating_sub(1)),
            (_, as_before) => as_before,
        };
        self.is_motor_last = false;
    }
}
