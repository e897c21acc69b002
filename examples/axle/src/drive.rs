//! `axle drive`: drives a rover, and stops it before the tool exits.

use std::fmt;

use axlewire::{
    time::{Duration, Instant},
    ucp::{MotorControl, Telemetry},
};
use serde::Serialize;

use crate::{
    args::{self, Protocol},
    failure::{Failure, guarded},
    help::MOTION_HELP,
    line::Line,
    report::{Form, Outcome},
    rover::{self, CALL_PERIOD, Rover},
    signals::{Attendance, DEAD_MAN, Signals},
    teller::{self, Teller},
    watch::moving::{About, Page, PageArgs},
};

/// Drive a rover for a set time
///
/// Sends stops until the robot is heard. Then repeats the command every 100 ms and prints the
/// robot's reports. At the end, on every error and on every signal that can be caught (Ctrl-C,
/// Ctrl-Z, Ctrl-\, a kill without -9; not those of a crash, nor 32 and 33, which belong to the C
/// library, nor SIGXFSZ, which only ends a recording), the tool repeats the stop until the reports
/// show that all wheels have stopped; a second Ctrl-C does not cut this short. If the robot is no
/// longer heard, or sends no reports, it may be moving: the tool says so, and the exit code is 1.
/// After Ctrl-Z and fg nothing moves again, and the exit code is 1.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// Speed, -100 to 100 percent; positive is forward; by default 0, for turning on the spot
    #[arg(
        long,
        value_name = "S",
        allow_negative_numbers = true,
        value_parser = args::percent(),
        default_value = "0",
        hide_default_value = true,
        required_unless_present = "turn"
    )]
    speed: i16,

    /// Steering, -100 to 100 percent; positive is to the right, as on shipped robots (the protocol
    /// document says left). Going forward or turning on the spot, the nose then swings right; in
    /// reverse, with a speed below -5, it swings left, as in a car; by default 0
    #[arg(
        long,
        value_name = "T",
        allow_negative_numbers = true,
        value_parser = args::percent(),
        default_value = "0",
        hide_default_value = true
    )]
    turn: i16,

    /// Duration, seconds
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,

    #[command(flatten)]
    page: PageArgs,

    /// Print one JSON object per line; if the rover was commanded, the last is the outcome
    #[arg(short, long)]
    json: bool,
}

/// Interval between printed reports; the robot sends one every 20 ms.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let command = rover::motor_control(args.speed, args.turn)
        .map_err(|error| Failure::Usage(error.to_string()))?;
    let signals = Signals::listen_to_all()?;
    let result = prepare_and_drive(args, command, &signals);
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

fn prepare_and_drive(args: &Args, command: MotorControl, signals: &Signals) -> Result<(), Failure> {
    let baud = args.line.baud_for(Protocol::Ucp);
    let about = About { command: "drive", protocol: Protocol::Ucp, baud };
    let wire = Line::open(&args.line, Protocol::Ucp)?;
    let (page, wire) = args.page.open(wire, &about, signals)?;
    let mut rover = Rover::on(wire, &args.line);
    if !rover.find(|| signals.is_raised())? {
        return signals.interrupted();
    }
    // Print before anything moves: a terminal may suspend a background process that prints.
    let (form, target) = (Form::of(args.json), Event::target(&command));
    if let Some(line) = page.note(form.line(0, &target)) {
        teller::print(&line).map_err(Failure::Write)?;
    }
    let start = rover.now();
    let drive = Drive { rover, start, form, teller: Teller::new(), page, left: Ok(()) };
    drive.run(command, args.micros, signals)
}

/// What happens to the rover.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    Target {
        speed: i16,
        angular: i16,
        #[serde(skip)]
        text: String,
    },
    Report(Report),
    Stopped(Report),
}

/// The robot's latest report.
#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    telemetry: Telemetry,
    reports_lost: u32,
    #[serde(skip)]
    text: String,
}

impl Event {
    fn target(command: &MotorControl) -> Self {
        let text = rover::describe(command);
        Self::Target { speed: command.speed(), angular: command.angular(), text }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Target { text, .. } => write!(f, "target: {text}"),
            Self::Report(report) => f.write_str(&report.text),
            Self::Stopped(report) => write!(f, "{}, stopped", report.text),
        }
    }
}

struct Drive {
    rover: Rover,
    start: Instant,
    form: Form,
    teller: Teller,
    page: Page,
    /// Whether leaving the page worked.
    left: Result<(), Failure>,
}

impl Drive {
    /// Drives; then stops, whatever happened.
    fn run(mut self, command: MotorControl, micros: u64, signals: &Signals) -> Result<(), Failure> {
        let driven = guarded(|| self.drive(command, micros, signals));
        // In any case, stop the wheels first and report errors afterwards. That the wheels may
        // still turn is the most serious error.
        let stopped = self.stop();
        let is_at_rest = stopped.is_ok();
        let besides = |failure: Failure| failure.and("it was stopped and is at rest");
        let result = stopped.and(driven.map_err(besides));
        let result = result.and_then(|()| self.rover.check_recording());
        Outcome::of(&result, is_at_rest).say(self.form, &mut self.teller);
        let told = self.teller.finish();
        result.and(self.left).and(told)
    }

    /// Drives until the time is up or a signal comes.
    fn drive(
        &mut self,
        command: MotorControl,
        micros: u64,
        signals: &Signals,
    ) -> Result<(), Failure> {
        let end = Instant::from_micros(self.start.as_micros() + micros);
        let mut print_at = self.start + PRINT_PERIOD;
        let mut attendance = Attendance::new(self.start);
        while !signals.is_raised() {
            let now = self.rover.now();
            // An absence ends the drive: the host stops the robot after one, but the next command
            // would drive it again. First: it also makes the other checks fail.
            attendance.check(now)?;
            if self.rover.has_dead_man_fired {
                return Err(Failure::Failed(DEAD_MAN.to_owned()));
            }
            self.rover.check_heard()?;
            if now >= end {
                break;
            }
            let driven = self.rover.host_mut().drive(command, now);
            driven.map_err(|error| Failure::Failed(error.to_string()))?;
            self.rover.round((now + CALL_PERIOD).min(end).min(print_at))?;
            if self.rover.now() >= print_at {
                print_at = self.rover.now() + PRINT_PERIOD;
                self.say_report(Event::Report)?;
            }
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), Failure> {
        self.page.stopping();
        let stopped = self.rover.stop();
        self.left = self.page.leave();
        stopped?;
        // If the output fails, the rover has stopped all the same.
        drop(self.say_report(Event::Stopped));
        Ok(())
    }

    fn say_report(&mut self, event: fn(Report) -> Event) -> Result<(), Failure> {
        let Some(text) = self.rover.describe() else { return Ok(()) };
        let host = self.rover.host();
        let Some(telemetry) = host.last_report().map(|report| report.telemetry) else {
            return Ok(());
        };
        let reports_lost = host.statistics().reports_lost;
        let event = event(Report { telemetry, reports_lost, text });
        let micros = self.rover.now().as_micros().saturating_sub(self.start.as_micros());
        let line = self.page.note(self.form.line(micros, &event));
        line.map_or(Ok(()), |line| self.teller.say(line))
    }
}

#[cfg(all(test, unix))]
mod tests;
