//! Turning and stopping: what happens once the target is known.

use std::fmt;

use axlewire::{
    ikeya::{NodeId, Target},
    time::{Duration, Instant},
};
use serde::Serialize;

use crate::{
    boards::Data,
    bus::{Boards, Bus},
    failure::{Failure, guarded},
    report::{Form, Outcome},
    signals::{Attendance, Signals},
    teller::Teller,
    watch::moving::Page,
};

/// Interval between printed measurements.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// Maximum age of a measurement that counts as current.
const FRESH: Duration = Duration::from_millis(250);

/// What happens to the node.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(super) enum Event {
    Target {
        node: NodeId,
        #[serde(flatten)]
        target: Data,
    },
    Measured {
        node: NodeId,
        #[serde(flatten)]
        status: Data,
    },
    Stopped {
        node: NodeId,
        #[serde(flatten)]
        status: Data,
    },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Target { node, target } => write!(f, "node {node}: target {target}"),
            Self::Measured { node, status } => write!(f, "node {node}: {status}"),
            Self::Stopped { node, status } => {
                write!(f, "node {node}: {status}, stopped and confirmed")
            }
        }
    }
}

pub(super) struct Spin<B: Boards> {
    pub(super) bus: Bus<B>,
    pub(super) node: NodeId,
    /// Time at which the motor was commanded.
    pub(super) start: Instant,
    pub(super) form: Form,
    pub(super) teller: Teller,
    pub(super) page: Page,
    /// Whether leaving the page worked.
    pub(super) left: Result<(), Failure>,
}

impl<B: Boards> Spin<B> {
    /// Commands the motor and watches it; then stops it, whatever happened.
    pub(super) fn run(
        mut self,
        target: Target<B>,
        micros: u64,
        signals: &Signals,
    ) -> Result<(), Failure> {
        let spun = guarded(|| self.spin(target, micros, signals));
        // In any case, stop the motor first and report errors afterwards. That it may still turn is
        // the most serious one.
        let stopped = self.stop();
        let is_at_rest = stopped.is_ok();
        let besides = |failure: Failure| failure.and("it was stopped and is at rest");
        let result = stopped.and(spun.map_err(besides));
        let result = result.and_then(|()| self.bus.check_recording());
        Outcome::of(&result, is_at_rest).say(self.form, &mut self.teller);
        let told = self.teller.finish();
        result.and(self.left).and(told)
    }

    /// Commands the motor and watches it until the time is up or a signal comes.
    fn spin(&mut self, target: Target<B>, micros: u64, signals: &Signals) -> Result<(), Failure> {
        self.bus.command(self.node, target, self.start)?;
        let end = Instant::from_micros(self.start.as_micros() + micros);
        let mut print_at = self.start + PRINT_PERIOD;
        let mut attendance = Attendance::new(self.start);
        while !signals.is_raised() {
            let now = self.bus.now();
            // First: an absence also makes the other checks fail.
            attendance.check(now)?;
            self.bus.check_follows(self.node, target)?;
            if now >= end {
                return self.check_reached(target);
            }
            self.bus.master_mut().keep_alive(now);
            self.bus.round(end.min(print_at))?;
            if self.bus.now() >= print_at {
                print_at = self.bus.now() + PRINT_PERIOD;
                self.say_status(false)?;
            }
        }
        Ok(())
    }

    /// Checks at the end that the motor has reached its target.
    fn check_reached(&mut self, target: Target<B>) -> Result<(), Failure> {
        let (node, now) = (self.node, self.bus.now());
        let measured = self.bus.master().status(node);
        let fresh = measured.filter(|&(_, at)| at > self.start && now - at <= FRESH);
        let line = match fresh {
            Some((status, _)) if B::is_reached(target, status) => return Ok(()),
            Some((status, _)) => {
                let (now, target) = (B::data(status), data(target));
                format!("node {node} was at {now} when the time was up, target {target}")
            }
            None => format!("node {node} has no current measurement at the end of the time"),
        };
        Err(Failure::Failed(line))
    }

    /// Stops the motor and waits until it is at rest (rulings I6, I12).
    fn stop(&mut self) -> Result<(), Failure> {
        self.page.stopping();
        let halted = self.bus.halt_all(self.node.into());
        self.left = self.page.leave();
        if halted.is_ok() {
            // If the output fails, the motor has stopped all the same.
            drop(self.say_status(true));
        }
        halted
    }

    fn say_status(&mut self, is_stopped: bool) -> Result<(), Failure> {
        let Some(status) = self.bus.status(self.node) else { return Ok(()) };
        let (node, status) = (self.node, B::data(status));
        let event = match is_stopped {
            true => Event::Stopped { node, status },
            false => Event::Measured { node, status },
        };
        let micros = self.bus.now().as_micros().saturating_sub(self.start.as_micros());
        let line = self.page.note(self.form.line(micros, &event));
        line.map_or(Ok(()), |line| self.teller.say(line))
    }
}

pub(super) fn data<B: Boards>(target: Target<B>) -> Data {
    B::data(B::reached(target))
}

#[cfg(all(test, unix))]
mod tests;
