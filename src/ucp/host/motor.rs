//! The motor command: the latest wins, is repeated, and does not outlive its application.

use super::HostConfig;
use crate::{
    time::Instant,
    ucp::{
        MotorControl,
        role::{halted, reached, stands_still},
    },
};

/// Which motor command is sent when.
#[derive(Debug, Default)]
pub(super) struct Motor {
    latest: Option<MotorControl>,
    sent: Option<(MotorControl, Instant)>,
    /// When the latest is to be sent.
    due: Option<Instant>,
    /// When the application has been silent for too long; set while the robot moves.
    dead_man: Option<Instant>,
}

impl Motor {
    /// The latest command, halted by now if the application has gone silent.
    pub(super) const fn latest(&self) -> Option<MotorControl> {
        self.latest
    }

    pub(super) fn command(&mut self, command: MotorControl, now: Instant, config: &HostConfig) {
        let still = stands_still(&command);
        self.latest = Some(command);
        self.dead_man = (!still).then(|| now + config.command_timeout);
        let earliest = match self.sent {
            // What the robot has been told already can wait for its turn.
            Some((sent, _)) if sent == command && self.due.is_some() => return,
            Some((sent, at)) if !still || stands_still(&sent) => now.max(at + config.command_gap),
            _ => now,
        };
        self.due = Some(earliest);
    }

    /// Halts when the application has been silent for too long; says whether that is now.
    pub(super) fn expire(&mut self, now: Instant) -> bool {
        let silent = reached(self.dead_man, now);
        if silent {
            self.dead_man = None;
            self.latest = self.latest.as_ref().map(halted);
            self.due = Some(now);
        }
        silent
    }

    /// The command to send now, if any.
    pub(super) fn take(&mut self, now: Instant, config: &HostConfig) -> Option<MotorControl> {
        let command = self.latest.filter(|_| reached(self.due, now))?;
        self.sent = Some((command, now));
        self.due = Some(now + config.command_period);
        Some(command)
    }

    /// Sends no more until the next command.
    pub(super) fn pause(&mut self) {
        self.due = None;
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        [self.due, self.dead_man].into_iter().flatten().min()
    }
}
