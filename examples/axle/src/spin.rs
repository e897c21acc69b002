//! `axle spin`: turns one motor, and stops it before the tool exits.

use axlewire::{
    ikeya::{self, Mode, NodeId, Position, Rps, Status, Target, board::OneMotor},
    time::{Duration, Instant},
};

use crate::{
    MOTION_HELP,
    args::{self, Protocol},
    bus::{self, Boards, Bus},
    failure::{Failure, guarded},
    line::Line,
    signals::{Attendance, DEAD_MAN, Signals},
    teller::{self, Teller},
    watch::moving::{About, Page, PageArgs},
};

/// Turn one motor of a motor bus for a set time
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
/// rps, whichever is more; the last position must be within 8 counts.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// The node, 1 to 8
    #[arg(long, value_name = "N", value_parser = args::node)]
    node: NodeId,

    #[command(flatten)]
    goal: GoalArgs,

    #[command(flatten)]
    page: PageArgs,

    /// Refuse an --rps faster than this, in either direction, to guard against typos
    #[arg(long, value_name = "X", default_value = "20", value_parser = args::max_rps)]
    max_rps: Rps,

    /// Duration, seconds
    #[arg(long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct GoalArgs {
    /// For a velocity node: turn at this speed, revolutions per second
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = args::rps)]
    rps: Option<Rps>,

    /// For a position node: move by this many revolutions from where it is
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = args::revolutions)]
    revolutions: Option<Position>,
}

/// Interval between printed measurements.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// Longest interval between two rounds on the bus: well under the master's dead-man timeout.
const CALL_PERIOD: Duration = Duration::from_millis(50);

/// Maximum age of a measurement that counts as current.
const FRESH: Duration = Duration::from_millis(250);

/// Largest difference between a position and its target, counts.
const TARGET_COUNTS: u32 = 8;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(rps) = args.goal.rps
        && rps.get().abs() > args.max_rps.get()
    {
        let (rps, limit) = (rps.get(), args.max_rps.get());
        return Err(Failure::Usage(format!(
            "--rps {rps} is faster than --max-rps {limit}: raise the limit if you mean it"
        )));
    }
    let signals = Signals::listen_to_all()?;
    let result = prepare_and_spin(args, &signals);
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

fn prepare_and_spin(args: &Args, signals: &Signals) -> Result<(), Failure> {
    let port = args.bus.line();
    let wire = Line::open(port, ikeya::BAUD)?;
    let about = About {
        command: "spin",
        protocol: Protocol::Ikeya,
        baud: port.baud.unwrap_or(ikeya::BAUD),
        has_echo: args.bus.config().removes_echo,
    };
    let (page, wire) = args.page.open::<ikeya::BothDirections>(wire, &about, signals)?;
    let config = bus::complete(args.bus.config(), port, &wire);
    let mut bus = Bus::new(wire, config);
    if !bus.discover(signals)? {
        return signals.interrupted();
    }
    let node = args.node;
    let found = choose(args, &bus, bus.status(node))?;
    // Print before anything moves: a terminal may suspend a background process that prints.
    if let Some(line) = page.note(line(0.0, node, &announce(found))) {
        teller::print(&line).map_err(Failure::Write)?;
    }

    // Discovery took a while, and so may the reader of that line: the mode may have changed.
    let status = bus.read(node, signals)?;
    if signals.is_raised() {
        return signals.interrupted();
    }
    if bus.master().is_mode_in_doubt(node) {
        return Err(Failure::Failed(format!("the mode of node {node} is in doubt")));
    }
    let target = choose(args, &bus, status)?;
    let start = bus.now();
    let mut spin = Spin { bus, node, start, teller: Teller::new(), page, left: Ok(()) };

    let spun = guarded(|| spin.spin(target, args.micros, signals));
    // In any case, stop the motor first and report errors afterwards. That it may still turn is the
    // most serious one.
    let stopped = spin.stop();
    let told = spin.teller.finish();
    stopped?;
    spun.map_err(|failure| failure.and("it was stopped and is at rest"))?;
    spin.left?;
    told
}

/// The target for this node, if it answers and is in the right mode.
fn choose(args: &Args, bus: &Bus, status: Option<Status<OneMotor>>) -> Result<Target, Failure> {
    let node = args.node;
    let refuse = |line: String| Err(Failure::Failed(line));
    match (status, args.goal.rps, args.goal.revolutions) {
        (Some(Status::Velocity(_)), Some(rps), _) => Ok(Target::Velocity(rps)),
        (Some(Status::Position(at)), _, Some(way)) => {
            let goal = at.counts().checked_add(way.counts()).map(Position::from_counts);
            match goal {
                Some(Ok(goal)) => Ok(Target::Position(goal)),
                _ => refuse(format!(
                    "node {node} is at {:.4} turns: {:.4} turns more exceed the range of a \
                     position",
                    at.revolutions(),
                    way.revolutions(),
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

fn announce(target: Target) -> String {
    match target {
        Target::Velocity(rps) => format!("target {:.2} rps", rps.get()),
        Target::Position(position) => format!("target {:.4} turns", position.revolutions()),
    }
}

fn line(seconds: f64, node: NodeId, what: &str) -> String {
    format!("{seconds:7.2} s  node {node}: {what}")
}

struct Spin {
    bus: Bus,
    node: NodeId,
    /// Time at which the motor was commanded.
    start: Instant,
    teller: Teller,
    page: Page,
    /// Whether the page could be left.
    left: Result<(), Failure>,
}

impl Spin {
    /// Commands the motor and watches it until the time is up or a signal comes.
    fn spin(&mut self, target: Target, micros: u64, signals: &Signals) -> Result<(), Failure> {
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
                self.say_status("")?;
            }
        }
        Ok(())
    }

    /// The master refuses a target for any mode other than the last one reported.
    fn command(&mut self, target: Target) -> Result<(), Failure> {
        let (master, node) = (self.bus.master_mut(), self.node);
        match target {
            Target::Velocity(rps) => master.set_velocity(node, rps, self.start),
            Target::Position(position) => master.set_position(node, position, self.start),
        }
        .map_err(|error| Failure::Failed(error.to_string()))
    }

    /// Fails if the node no longer follows its command.
    fn check_follows(&self, target: Target) -> Result<(), Failure> {
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
    fn check_reached(&mut self, target: Target) -> Result<(), Failure> {
        let (node, now) = (self.node, self.bus.now());
        let measured = self.bus.master().status(node);
        let fresh = measured.filter(|&(_, at)| at > self.start && now - at <= FRESH);
        let line = match fresh {
            Some((status, _)) if is_reached(target, status) => return Ok(()),
            Some((status, _)) => {
                let (now, target) = (OneMotor::describe(status), announce(target));
                format!("node {node} was at {now} when the time was up, {target}")
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
            drop(self.say_status(", stopped and confirmed"));
            return Ok(());
        };
        Err(match failure {
            Some(failure) => failure.while_moving(&complaint),
            None => Failure::Failed(complaint),
        })
    }

    fn say_status(&mut self, what: &str) -> Result<(), Failure> {
        let Some(status) = self.bus.status(self.node) else { return Ok(()) };
        let seconds = (self.bus.now() - self.start).as_micros() as f64 / 1e6;
        let what = format!("{}{what}", OneMotor::describe(status));
        let line = self.page.note(line(seconds, self.node, &what));
        line.map_or(Ok(()), |line| self.teller.say(line))
    }
}

fn is_reached(target: Target, status: Status<OneMotor>) -> bool {
    match (target, status) {
        (Target::Velocity(target), Status::Velocity(now)) => {
            (now - target.get()).abs() <= tolerance(target)
        }
        (Target::Position(target), Status::Position(now)) => {
            now.counts().abs_diff(target.counts()) <= TARGET_COUNTS
        }
        _ => false,
    }
}

/// Largest difference between a speed and its target, rps. A motor at rest has not reached a slow
/// target speed, unless that speed itself counts as rest.
fn tolerance(target: Rps) -> f32 {
    let target = target.get().abs();
    (target * 0.1).max((target * 0.5).min(0.1)).max(0.05)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn velocity(target: f32, now: f32) -> bool {
        is_reached(Target::Velocity(Rps::new(target).unwrap()), Status::Velocity(now))
    }

    #[test]
    fn a_speed_is_reached_within_10_percent_or_a_tenth() {
        assert!(velocity(10.0, 9.01) && velocity(10.0, 10.99) && velocity(-10.0, -9.01));
        assert!(!velocity(10.0, 8.99) && !velocity(10.0, 11.01) && !velocity(-10.0, 10.0));
        assert!(velocity(0.5, 0.41) && !velocity(0.5, 0.39));
    }

    #[test]
    fn a_motor_that_stands_still_has_not_reached_a_slow_speed() {
        assert!(!velocity(0.12, 0.0) && !velocity(-0.12, 0.0) && velocity(0.12, 0.08));
        assert!(velocity(0.0, 0.04) && !velocity(0.0, 0.06) && !velocity(1.0, f32::NAN));
    }

    #[test]
    fn a_position_is_reached_within_8_counts_and_no_speed_is_a_position() {
        let target = Target::Position(Position::from_counts(8000).unwrap());
        let at = |counts| Status::Position(Position::from_counts(counts).unwrap());
        assert!(is_reached(target, at(8008)) && is_reached(target, at(7992)));
        assert!(!is_reached(target, at(8009)) && !is_reached(target, at(7991)));
        assert!(!is_reached(target, Status::Velocity(8000.0)));
    }
}
