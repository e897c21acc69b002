//! The line of a rover, and the host that commands it.

use axlewire::{
    time::{Duration, Instant},
    ucp::host::HostConfig,
};

use super::{
    effect::{Effect, Side},
    plan::{Due, Plan},
    playing::{Given, Voice},
};
use crate::{failure::Failure, line::Line, rover::Rover, signals::Signals};

/// A rover. Its host tells it to stand still before the first frame and until the first command
/// (ruling U16); what is no motor command leaves between the frames of the host. In the place of a
/// robot, the host is silent.
pub(super) struct Wheels {
    rover: Rover,
    /// Whether the plan commands it, if only to stand still.
    is_commanded: bool,
    /// How many commands had been sent when the latest was given.
    commands: Option<u32>,
    is_json: bool,
}

impl Voice for Wheels {
    /// Waits until the robot is heard, if the plan commands it.
    fn prepare(plan: &Plan<'_>, line: Line, signals: &Signals) -> Result<Option<Self>, Failure> {
        let is_commanded = plan.frames.iter().any(|due| matches!(due.effect, Effect::Wheels(_)));
        let mut config = HostConfig::default();
        // What else is said is a matter of the plan.
        config.sends_first_stop = plan.side == Side::Commander;
        config.low_ids_only = true;
        // The capture has its own pace.
        config.command_gap = Duration::ZERO;
        config.ping_period = config.ping_period.filter(|_| is_commanded);
        let mut rover = Rover::with(config, line, plan.bus.line());
        if is_commanded && !rover.find(|| signals.is_raised())? {
            return Ok(None);
        }
        Ok(Some(Self { rover, is_commanded, commands: None, is_json: plan.is_json }))
    }

    fn now(&mut self) -> Instant {
        self.rover.now()
    }

    /// Whether the robot has been told what to do: no command replaces one that waits.
    fn is_free(&self) -> bool {
        self.rover.is_told() && self.commands.is_none_or(|before| self.sent() != before)
    }

    fn give(&mut self, due: &Due, now: Instant) -> Result<Given, Failure> {
        let Effect::Wheels(command) = due.effect else {
            self.rover.others_have_pinged();
            return self.rover.interject(&due.bytes).map(Given::whole);
        };
        // A command that is in force is repeated by the host.
        let is_new = self.rover.host().command() != Some(command);
        self.commands = is_new.then(|| self.sent());
        match self.rover.host_mut().drive(command, now) {
            Ok(()) => Ok(Given::Taken),
            Err(error) => Err(Failure::Failed(error.to_string())),
        }
    }

    fn check(&self) -> Result<(), Failure> {
        if self.is_commanded { self.rover.check_heard() } else { Ok(()) }
    }

    fn round(&mut self, until: Instant) -> Result<(), Failure> {
        self.rover.round(until)
    }

    fn stop(mut self) -> Result<Vec<String>, Failure> {
        if !self.is_commanded {
            return Ok(Vec::new());
        }
        self.rover.stop()?;
        let report = self.rover.describe().unwrap_or_default();
        Ok(vec![match self.is_json {
            true => "{\"event\":\"stopped\"}".to_owned(),
            false => format!("robot: {report}, stopped"),
        }])
    }
}

impl Wheels {
    /// How many commands have been sent.
    fn sent(&self) -> u32 {
        self.rover.host().statistics().commands
    }
}
