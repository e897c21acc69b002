//! `axle spin`: one motor turns, and stands still again before the tool ends.

use std::io::{self, Write};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Cause, Health, MasterEvent, NodeId, OneMotor, Position, Rps, Status, WriteRequest},
    stream::Encode,
    time::{Duration, Instant},
};

use crate::{
    EXIT_CODES, args,
    bus::{self, Bus, Measured},
    ctrl_c::CtrlC,
    failure::Failure,
    port::Line,
};

/// Turn one motor of a motor bus for a while
///
/// Finds the node, commands it and prints what it measures. At the end, on Ctrl-C and on every error
/// the motor is stopped: a velocity node gets 0 rps, a position node holds the position measured
/// last. The tool waits until the motor stands still, and says so.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// The node, 1 to 8
    #[arg(long, value_name = "N", value_parser = args::node)]
    node: NodeId,

    #[command(flatten)]
    goal: GoalArgs,

    /// How long, seconds
    #[arg(long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct GoalArgs {
    /// For a velocity node: turn at this speed, revolutions per second
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = args::rps)]
    rps: Option<Rps>,

    /// For a position node: go so many revolutions on from where it stands
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = args::revolutions)]
    revolutions: Option<Position>,
}

/// What the motor is to do.
#[derive(Clone, Copy, Debug)]
enum Goal {
    Turn(Rps),
    GoTo(Position),
}

/// How often the measured value is printed.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// How long a motor may take to stand still once it is told to.
const STOP_PATIENCE: Duration = Duration::from_millis(3000);

/// Slower than this is standing still: 1/20 rps, and as much between two positions 20 ms apart.
const STILL_RPS: f32 = 0.05;
const STILL_COUNTS: u32 = 8;

/// How often a stop is sent to a node that no longer answers.
const BLIND_STOPS: u32 = 5;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let ctrl_c = CtrlC::listen()?;
    let mut bus = Bus::open(&args.bus)?;
    if !bus.discover(&ctrl_c)? {
        return Err(Failure::Undone("interrupted before anything moved".to_owned()));
    }
    let goal = choose(args, &bus)?;
    let (node, start) = (args.node, bus.port.now());
    let mut spin = Spin { bus, node, start, failure: None, out: io::stdout() };
    let consequence = format!("node {node} cannot be told to stop any more");

    let spun = spin.spin(goal, args.micros, &ctrl_c);
    if let Err(failure @ Failure::PortLost { .. }) = spun {
        return Err(failure.while_moving(&consequence));
    }
    // Whatever else has happened: first the motor, then the complaint. That it may still turn is the
    // gravest of all.
    spin.stop().map_err(|failure| failure.while_moving(&consequence))?;
    spun
}

/// What this node is to do, if it is there and in the right mode.
fn choose(args: &Args, bus: &Bus) -> Result<Goal, Failure> {
    let node = args.node;
    let refuse = |line: String| Err(Failure::Undone(line));
    match (bus.status(node), args.goal.rps, args.goal.revolutions) {
        (Some(Status::Velocity(_)), Some(rps), _) => Ok(Goal::Turn(rps)),
        (Some(Status::Position(at)), _, Some(way)) => {
            let goal = at.counts().checked_add(way.counts()).map(Position::from_counts);
            match goal {
                Some(Ok(goal)) => Ok(Goal::GoTo(goal)),
                _ => refuse(format!(
                    "node {node} is at {}: {} more are beyond what a position can tell",
                    Measured(Status::Position(at)),
                    Measured(Status::Position(way)),
                )),
            }
        }
        (Some(Status::Velocity(_)), ..) => {
            refuse(format!("node {node} is in velocity mode: use --rps"))
        }
        (Some(Status::Position(_)), ..) => {
            refuse(format!("node {node} is in position mode: use --revolutions"))
        }
        (None, ..) => {
            let found: Vec<_> =
                bus.nodes().map(|(node, mode, _)| format!("{node} ({mode})")).collect();
            let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
            refuse(format!("node {node} does not answer; nodes that do: {found}"))
        }
    }
}

struct Spin {
    bus: Bus,
    node: NodeId,
    /// Since when the motor has been commanded.
    start: Instant,
    /// What was heard instead of the last answer that failed.
    failure: Option<Cause>,
    out: io::Stdout,
}

impl Spin {
    /// Commands the motor and watches it until the time is over.
    fn spin(&mut self, goal: Goal, micros: u64, ctrl_c: &CtrlC) -> Result<(), Failure> {
        let commanded = match goal {
            Goal::Turn(rps) => self.bus.master.set_velocity(self.node, rps),
            Goal::GoTo(position) => self.bus.master.set_position(self.node, position),
        };
        commanded.map_err(|error| Failure::Undone(error.to_string()))?;
        self.say(&match goal {
            Goal::Turn(rps) => format!("to turn at {:.2} rps", rps.get()),
            Goal::GoTo(position) => format!("to go to {:.4} turns", position.revolutions()),
        })?;

        let end = Instant::from_micros(self.start.as_micros() + micros);
        let mut print_at = self.start + PRINT_PERIOD;
        while self.bus.port.now() < end && !ctrl_c.is_pressed() {
            self.bus.round(end.min(print_at))?;
            while let Some(event) = self.bus.master.poll_event() {
                self.look_at(event)?;
            }
            if self.bus.port.now() >= print_at {
                print_at = self.bus.port.now() + PRINT_PERIOD;
                self.say_status("")?;
            }
        }
        Ok(())
    }

    /// Ends the spin where the node no longer follows.
    fn look_at(&mut self, event: MasterEvent) -> Result<(), Failure> {
        let node = self.node;
        match event {
            MasterEvent::ReadFailed { node: failed, cause } if failed == node => {
                self.failure = Some(cause);
                if self.is_online() {
                    return Ok(());
                }
                Err(Failure::Undone(format!("node {node} does not answer any more")))
            }
            MasterEvent::ModeChanged { node: changed, mode } if changed == node => {
                Err(Failure::Undone(format!("node {node} has changed to {mode} mode")))
            }
            _ => Ok(()),
        }
    }

    fn is_online(&self) -> bool {
        matches!(self.bus.master.health(self.node), Some(Health::Online | Health::Suspect(_)))
    }

    /// Stops the motor (ruling I6), and waits until it has answered that it stands still.
    fn stop(&mut self) -> Result<(), Failure> {
        let (node, end) = (self.node, self.bus.port.now() + STOP_PATIENCE);
        let (mut confirmed, mut before) = (false, None);
        if self.order_stop().is_err() {
            return self.stop_blindly();
        }
        while self.bus.port.now() < end {
            self.bus.round(end)?;
            while let Some(event) = self.bus.master.poll_event() {
                match event {
                    MasterEvent::Confirmed { node: it } if it == node => confirmed = true,
                    MasterEvent::NotConfirmed { node: it, cause } if it == node => {
                        self.failure = Some(cause);
                        // Refused where the node is abnormal, which ends this below.
                        let _ = self.bus.master.confirm(node);
                    }
                    MasterEvent::ModeChanged { node: it, .. } if it == node => {
                        let _ = self.order_stop();
                    }
                    MasterEvent::Status { node: it, status } if it == node && confirmed => {
                        if stands_still(before, status) {
                            // Where nobody reads that, it stands all the same.
                            drop(self.say_status(", stopped and confirmed"));
                            return Ok(());
                        }
                        before = Some(status);
                    }
                    _ => {}
                }
            }
            if !self.is_online() {
                return self.stop_blindly();
            }
        }
        let patience = STOP_PATIENCE.as_micros() / 1_000_000;
        Err(Failure::Undone(match self.bus.status(node) {
            Some(status) if confirmed => {
                let now = Measured(status);
                format!("node {node} was told to stop and still moves after {patience} s: {now}")
            }
            _ => format!("node {node} was told to stop and has not confirmed it in {patience} s"),
        }))
    }

    fn order_stop(&mut self) -> Result<(), axlewire::ikeya::CommandError> {
        self.bus.master.stop(self.node)?;
        self.bus.master.confirm(self.node)
    }

    /// The node does not answer, but may still hear: sends the stop without the master, which
    /// commands only who answers.
    fn stop_blindly(&mut self) -> Result<(), Failure> {
        let node = self.node;
        let packet = match self.bus.status(node) {
            Some(Status::Position(held)) => WriteRequest::position(node, held),
            _ => WriteRequest::velocity(node, Rps::ZERO),
        };
        let mut buffer = [0; WriteRequest::LEN];
        let bytes =
            packet.encode(&mut buffer).map_err(|error| Failure::Undone(error.to_string()))?;
        for _ in 0..BLIND_STOPS {
            self.bus.port.send(bytes)?;
            let pause = self.bus.port.now() + Duration::from_millis(20);
            while self.bus.port.now() < pause {
                self.bus.port.receive(pause)?;
            }
        }
        let heard = match self.failure {
            Some(Cause::Damaged) => "damaged bytes are heard",
            Some(Cause::Unexpected) => "other answers are heard",
            _ => "nothing is heard",
        };
        Err(Failure::Undone(format!(
            "node {node} does not answer any more ({heard}): a stop was sent {BLIND_STOPS} times, \
             unconfirmed"
        )))
    }

    fn say_status(&mut self, what: &str) -> Result<(), Failure> {
        match self.bus.status(self.node) {
            Some(status) => self.say(&format!("{}{what}", Measured(status))),
            None => Ok(()),
        }
    }

    fn say(&mut self, what: &str) -> Result<(), Failure> {
        let seconds = (self.bus.port.now() - self.start).as_micros() as f64 / 1e6;
        writeln!(self.out, "{seconds:7.2} s  node {}: {what}", self.node)
            .and_then(|()| self.out.flush())
            .map_err(Failure::Write)
    }
}

/// Does a motor that measures `now`, and measured `before`, stand still?
fn stands_still(before: Option<Status<OneMotor>>, now: Status<OneMotor>) -> bool {
    match (before, now) {
        (_, Status::Velocity(rps)) => rps.abs() <= STILL_RPS,
        (Some(Status::Position(before)), Status::Position(now)) => {
            before.counts().abs_diff(now.counts()) <= STILL_COUNTS
        }
        _ => false,
    }
}
