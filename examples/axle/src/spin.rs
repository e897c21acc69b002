//! `axle spin`: turns one motor, and stops it before the tool exits.

use std::fmt;

use axlewire::{
    ikeya::{
        Mode, NodeId, Position, Rps, Status, Target,
        board::{OneMotor, ThreeMotors},
    },
    time::{Duration, Instant},
};
use serde::Serialize;

use crate::{
    MOTION_HELP,
    args::{self, BusProtocol},
    boards::{Boards, Data},
    bus::{self, Bus},
    failure::{Failure, guarded},
    line::Line,
    report::{Form, Outcome},
    signals::{Attendance, DEAD_MAN, Signals},
    teller::{self, Teller},
    watch::moving::{About, Page, PageArgs},
};

/// Turn one motor of a motor bus, or the three of a board, for a set time
///
/// Finds the node, reads it again, commands it and prints its measurements. At the end, on every
/// error and on every signal that can be caught (Ctrl-C, Ctrl-Z, Ctrl-\, a kill without -9; not
/// those of a crash, nor 32 and 33, which belong to the C library), the motor is stopped: a
/// velocity node gets 0 rps, a position node holds the position read at that moment. The tool
/// continues until the node has confirmed the stop twice and the motor is at rest, or else reports
/// what is known; a second Ctrl-C does not cut this short. After Ctrl-Z and fg nothing moves again,
/// and the exit code is 1.
///
/// The exit code is also 1 if the target is not reached when the time is up: the last speed must be
/// within 10 % or 0.1 rps of it, whichever is more, but not off by more than half of it or 0.05
/// rps, whichever is more; the last position must be within 8 counts. On a board with three motors
/// that holds for each.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// Boards on the bus; three-motor boards take three values for --rps and --revolutions
    #[arg(short = 'P', long, value_enum, default_value = "ikeya")]
    protocol: BusProtocol,

    /// The node, 1 to 8
    #[arg(short, long, value_name = "N", value_parser = args::node)]
    node: NodeId,

    #[command(flatten)]
    goal: GoalArgs,

    #[command(flatten)]
    page: PageArgs,

    /// Refuse an --rps faster than this, in either direction, to guard against typos
    #[arg(long, value_name = "X", default_value = "20", value_parser = args::max_rps)]
    max_rps: Rps,

    /// Duration, seconds
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,

    /// Print one JSON object per line; if the motor was commanded, the last is the outcome
    #[arg(short, long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct GoalArgs {
    /// For a velocity node: turn at this speed, revolutions per second
    #[arg(long, value_name = "X", num_args = 1..=3, allow_negative_numbers = true, value_parser = args::rps)]
    rps: Vec<Rps>,

    /// For a position node: move by this many revolutions from where it is
    #[arg(long, value_name = "X", num_args = 1..=3, allow_negative_numbers = true, value_parser = args::revolutions)]
    revolutions: Vec<Position>,
}

/// Interval between printed measurements.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// Longest interval between two rounds on the bus: well under the master's dead-man timeout.
const CALL_PERIOD: Duration = Duration::from_millis(50);

/// Maximum age of a measurement that counts as current.
const FRESH: Duration = Duration::from_millis(250);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let limit = args.max_rps.get();
    if let Some(rps) = args.goal.rps.iter().map(|rps| rps.get()).find(|rps| rps.abs() > limit) {
        return Err(Failure::Usage(format!(
            "--rps {rps} is faster than --max-rps {limit}: raise the limit if you mean it"
        )));
    }
    match args.protocol {
        BusProtocol::Ikeya => run_on::<OneMotor>(args),
        BusProtocol::Ikeya3 => run_on::<ThreeMotors>(args),
    }
}

fn run_on<B: Boards>(args: &Args) -> Result<(), Failure> {
    let goal = Goal::<B>::new(&args.goal).ok_or_else(|| {
        let (one, name) = (B::MOTORS == 1, B::PROTOCOL.name());
        let count = if one { "one value" } else { "three values" };
        Failure::Usage(format!("with --protocol {name}, --rps and --revolutions take {count}"))
    })?;
    let signals = Signals::listen_to_all()?;
    let form = Form::of(args.json);
    let result = match prepare(args, &goal, form, &signals) {
        Ok(Some((spin, target))) => spin.run(target, args.micros, &signals),
        Ok(None) => signals.interrupted(),
        Err(failure) => Err(failure),
    };
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

/// What was asked for.
#[derive(Clone, Debug)]
enum Goal<B: Boards> {
    Speed(B::Velocity),
    /// A way from where the motors are.
    Way(Vec<Position>),
}

impl<B: Boards> Goal<B> {
    /// The goal, if it has a value for each motor.
    fn new(args: &GoalArgs) -> Option<Self> {
        match &args.revolutions[..] {
            [] => B::velocity(&args.rps).map(Self::Speed),
            way if way.len() == B::MOTORS => Some(Self::Way(way.to_vec())),
            _ => None,
        }
    }

    /// The target for this node, if it answers and is in the right mode.
    fn target(
        &self,
        node: NodeId,
        bus: &Bus<B>,
        status: Option<Status<B>>,
    ) -> Result<Target<B>, Failure> {
        let refuse = |line: String| Err(Failure::Failed(line));
        match (self, status) {
            (Self::Speed(speed), Some(Status::Velocity(_))) => Ok(Target::Velocity(*speed)),
            (Self::Way(way), Some(status @ Status::Position(_))) => {
                let starts = B::positions(status).unwrap_or_default();
                let mut goals = Vec::new();
                for (at, way) in starts.iter().zip(way) {
                    let goal = at.counts().checked_add(way.counts()).map(Position::from_counts);
                    let Some(Ok(goal)) = goal else {
                        return refuse(format!(
                            "node {node} is at {:.4} turns: {:.4} turns more exceed the range of \
                             a position",
                            at.revolutions(),
                            way.revolutions(),
                        ));
                    };
                    goals.push(goal);
                }
                match B::position(&goals) {
                    Some(goal) => Ok(Target::Position(goal)),
                    None => refuse(format!("node {node} has another number of motors")),
                }
            }
            (Self::Way(_), Some(Status::Velocity(_))) => {
                refuse(format!("node {node} is in velocity mode: use --rps"))
            }
            (Self::Speed(_), Some(Status::Position(_))) => {
                refuse(format!("node {node} is in position mode: use --revolutions"))
            }
            (_, None) => {
                let found: Vec<_> = bus
                    .nodes()
                    .filter(|(other, ..)| *other != node)
                    .map(|(node, mode, _)| format!("{node} ({mode})"))
                    .collect();
                let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
                refuse(format!("node {node} does not answer; nodes that do: {found}"))
            }
        }
    }
}

/// What is ready to turn, and how; `None` if a signal came first.
type Ready<B> = Option<(Spin<B>, Target<B>)>;

/// Opens the port and chooses the target.
fn prepare<B: Boards>(
    args: &Args,
    goal: &Goal<B>,
    form: Form,
    signals: &Signals,
) -> Result<Ready<B>, Failure> {
    let port = args.bus.line();
    let wire = Line::open(port, B::PROTOCOL)?;
    let about = About {
        command: "spin",
        protocol: B::PROTOCOL,
        baud: port.baud_for(B::PROTOCOL),
        has_echo: args.bus.config().removes_echo,
    };
    let (page, wire) = args.page.open(wire, &about, signals)?;
    let config = bus::complete(args.bus.config(), port, &wire);
    let mut bus = Bus::new(wire, config);
    if !bus.discover(signals)? {
        return Ok(None);
    }
    let node = args.node;
    let found = goal.target(node, &bus, bus.status(node))?;
    // Print before anything moves: a terminal may suspend a background process that prints.
    let event = Event::Target { node, target: data(found) };
    if let Some(line) = page.note(form.line(0, &event)) {
        teller::print(&line).map_err(Failure::Write)?;
    }

    // Discovery took a while, and so may the reader of that line: the mode may have changed.
    let status = bus.read(node, signals)?;
    if signals.is_raised() {
        return Ok(None);
    }
    if bus.master().is_mode_in_doubt(node) {
        return Err(Failure::Failed(format!("the mode of node {node} is in doubt")));
    }
    let target = goal.target(node, &bus, status)?;
    let start = bus.now();
    let (teller, left) = (Teller::new(), Ok(()));
    Ok(Some((Spin { bus, node, start, form, teller, page, left }, target)))
}

fn data<B: Boards>(target: Target<B>) -> Data {
    B::data(B::reached(target))
}

/// What happens to the node.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
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

struct Spin<B: Boards> {
    bus: Bus<B>,
    node: NodeId,
    /// Time at which the motor was commanded.
    start: Instant,
    form: Form,
    teller: Teller,
    page: Page,
    /// Whether the page could be left.
    left: Result<(), Failure>,
}

impl<B: Boards> Spin<B> {
    /// Commands the motor and watches it; then stops it, whatever happened.
    fn run(mut self, target: Target<B>, micros: u64, signals: &Signals) -> Result<(), Failure> {
        let spun = guarded(|| self.spin(target, micros, signals));
        // In any case, stop the motor first and report errors afterwards. That it may still turn is
        // the most serious one.
        let stopped = self.stop();
        let recorded = self.bus.check_recording();
        let is_at_rest = stopped.is_ok();
        let besides = |failure: Failure| failure.and("it was stopped and is at rest");
        let result = stopped.and(spun.map_err(besides));
        Outcome::of(&result, is_at_rest).say(self.form, &mut self.teller);
        let told = self.teller.finish();
        result.and(self.left).and(told).and(recorded)
    }

    /// Commands the motor and watches it until the time is up or a signal comes.
    fn spin(&mut self, target: Target<B>, micros: u64, signals: &Signals) -> Result<(), Failure> {
        self.command(target)?;
        let end = Instant::from_micros(self.start.as_micros() + micros);
        let mut print_at = self.start + PRINT_PERIOD;
        let mut attendance = Attendance::new(self.start);
        while !signals.is_raised() {
            let now = self.bus.now();
            attendance.check(now)?;
            if now >= end {
                return self.check_reached(target);
            }
            self.bus.master_mut().keep_alive(now);
            self.bus.round(end.min(print_at).min(now + CALL_PERIOD))?;
            attendance.check(self.bus.now())?;
            self.check_follows(target)?;
            if self.bus.now() >= print_at {
                print_at = self.bus.now() + PRINT_PERIOD;
                self.say_status(false)?;
            }
        }
        Ok(())
    }

    /// The master refuses a target for any mode other than the last one reported.
    fn command(&mut self, target: Target<B>) -> Result<(), Failure> {
        let (master, node) = (self.bus.master_mut(), self.node);
        match target {
            Target::Velocity(rps) => master.set_velocity(node, rps, self.start),
            Target::Position(position) => master.set_position(node, position, self.start),
        }
        .map_err(|error| Failure::Failed(error.to_string()))
    }

    /// Fails if the node no longer follows its command.
    fn check_follows(&self, target: Target<B>) -> Result<(), Failure> {
        let (bus, node) = (&self.bus, self.node);
        let refuse = |line: String| Err(Failure::Failed(line));
        match bus.master().mode(node) {
            _ if !bus.is_online(node) => refuse(format!("node {node} no longer answers")),
            Some(mode) if mode != target.mode() => {
                refuse(format!("node {node} has changed to {mode} mode"))
            }
            _ if bus.master().is_mode_in_doubt(node) => {
                let other = match target.mode() {
                    Mode::Velocity => Mode::Position,
                    Mode::Position => Mode::Velocity,
                };
                refuse(format!("node {node} has answered in {other} mode"))
            }
            _ if bus.has_dead_man_fired => refuse(DEAD_MAN.to_owned()),
            _ if bus.master().set_point(node) != Some(target) => {
                refuse(format!("node {node} has lost its command"))
            }
            _ => Ok(()),
        }
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
        let failure = self.bus.stop(self.node.into()).err();
        self.left = self.page.leave();
        let Some(complaint) = self.bus.complaint(self.node) else {
            // If the output fails, the motor has stopped all the same.
            drop(self.say_status(true));
            return Ok(());
        };
        Err(match failure {
            Some(failure) => failure.while_moving(&complaint),
            None => Failure::Failed(complaint),
        })
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
