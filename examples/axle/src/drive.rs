//! `axle drive`: a rover drives, and stands still again before the tool ends.

use std::io::{self, Write};

use axlewire::{
    endpoint::Endpoint,
    time::{Duration, Instant},
    ucp::{self, Host, HostConfig, Link, MotorControl},
};

use crate::{
    EXIT_CODES, args,
    ctrl_c::CtrlC,
    failure::Failure,
    port::{Line, Port},
};

/// Drive a rover for a while
///
/// Waits until the robot is heard, repeats the command every 100 ms and prints what the robot
/// reports. At the end, on Ctrl-C and on every error the rover is told to stand still, and the tool
/// waits until its wheels do.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::Line,

    /// Speed, -100 to 100 percent; positive is forward
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = percent())]
    speed: i16,

    /// Turn, -100 to 100 percent; positive is to the right, as robots do it (the protocol document
    /// says left)
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = percent())]
    turn: i16,

    /// How long, seconds
    #[arg(long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,
}

fn percent() -> clap::builder::RangedI64ValueParser<i16> {
    let limit = i64::from(MotorControl::LIMIT);
    clap::value_parser!(i16).range(-limit..=limit)
}

/// How often a report is printed; the robot sends one every 20 ms.
const PRINT_PERIOD: Duration = Duration::from_millis(250);

/// How long the robot may take to be heard first.
const LINK_PATIENCE: Duration = Duration::from_millis(2000);

/// How long the wheels may take to stand still once they are told to.
const STOP_PATIENCE: Duration = Duration::from_millis(3000);

/// How often a stop is sent at least.
const STOPS: u32 = 3;

/// Longest pause between two calls of the host: well under its dead-man's 500 ms.
const CALL_PERIOD: Duration = Duration::from_millis(50);

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let command = command(args).map_err(|error| Failure::Usage(error.to_string()))?;
    let ctrl_c = CtrlC::listen()?;
    let port = Port::open(&args.line, ucp::BAUD)?;
    let mut config = HostConfig::default();
    config.baud = args.line.baud.unwrap_or(ucp::BAUD);
    let start = port.now();
    let mut drive = Drive { host: Host::new(config, start), port, start, out: io::stdout() };
    if !drive.find_robot(&ctrl_c)? {
        return Err(Failure::Undone("interrupted before anything moved".to_owned()));
    }

    const CONSEQUENCE: &str = "the robot cannot be told to stop any more, and does so by itself \
                               after 500 ms";
    let driven = drive.drive(command, args.micros, &ctrl_c);
    if let Err(failure @ Failure::PortLost { .. }) = driven {
        return Err(failure.while_moving(CONSEQUENCE));
    }
    // Whatever else has happened: first the wheels, then the complaint. That they may still turn is
    // the gravest of all.
    drive.stop().map_err(|failure| failure.while_moving(CONSEQUENCE))?;
    driven
}

/// A turn by its direction's name, so that the sign is the one that robots mean (ruling U6).
fn command(args: &Args) -> Result<MotorControl, axlewire::error::EncodeError> {
    match args.turn {
        turn @ 0.. => MotorControl::turn_right(args.speed, turn),
        turn => MotorControl::turn_left(args.speed, -turn),
    }
}

struct Drive {
    host: Host,
    port: Port,
    start: Instant,
    out: io::Stdout,
}

impl Drive {
    /// Waits for the first sign of life; `false` if Ctrl-C came first.
    fn find_robot(&mut self, ctrl_c: &CtrlC) -> Result<bool, Failure> {
        let end = self.start + LINK_PATIENCE;
        while self.host.link() != Link::Up && !ctrl_c.is_pressed() {
            if self.port.now() >= end {
                let (path, seconds) = (self.port.path(), LINK_PATIENCE.as_micros() / 1_000_000);
                let heard = match self.host.counters().received {
                    0 => "nothing".to_owned(),
                    bytes => format!("{bytes} bytes that are no message"),
                };
                return Err(Failure::Undone(format!(
                    "no robot answers on {path:?}: {heard} in {seconds} s"
                )));
            }
            self.round(end)?;
        }
        Ok(!ctrl_c.is_pressed())
    }

    /// Drives until the time is over.
    fn drive(&mut self, command: MotorControl, micros: u64, ctrl_c: &CtrlC) -> Result<(), Failure> {
        self.start = self.port.now();
        let turn = command.angular();
        let side = if turn < 0 {
            " left"
        } else if turn > 0 {
            " right"
        } else {
            ""
        };
        let (speed, turn) = (command.speed(), turn.abs());
        self.say(&format!("to drive: speed {speed} %, turn {turn} %{side}"))?;

        let end = Instant::from_micros(self.start.as_micros() + micros);
        let mut print_at = self.start + PRINT_PERIOD;
        while self.port.now() < end && !ctrl_c.is_pressed() {
            let now = self.port.now();
            self.host.drive(command, now).map_err(|error| Failure::Undone(error.to_string()))?;
            self.round((now + CALL_PERIOD).min(end).min(print_at))?;
            if self.host.link() == Link::Down {
                return Err(Failure::Undone("the robot is not heard any more".to_owned()));
            }
            if self.port.now() >= print_at {
                print_at = self.port.now() + PRINT_PERIOD;
                self.say_report("")?;
            }
        }
        Ok(())
    }

    /// Sends the stop several times, and waits until the robot reports that it stands.
    fn stop(&mut self) -> Result<(), Failure> {
        let (begin, sent) = (self.port.now(), self.host.statistics().commands);
        let (end, mut reports) = (begin + STOP_PATIENCE, None);
        self.host.stop(begin);
        while self.port.now() < end {
            self.round(end)?;
            let stats = self.host.statistics();
            if stats.commands.saturating_sub(sent) < STOPS {
                continue;
            }
            // The report has to be younger than the last of the stops.
            let told_at = *reports.get_or_insert(stats.reports);
            if stats.reports > told_at && self.wheels_stand() {
                // Where nobody reads that, they stand all the same.
                drop(self.say_report(", stopped"));
                return Ok(());
            }
            if self.host.link() == Link::Down {
                break;
            }
        }
        let sent = self.host.statistics().commands.saturating_sub(sent);
        Err(Failure::Undone(match self.host.link() {
            Link::Up => {
                format!("the robot was told {sent} times to stop, and its wheels still turn")
            }
            _ => format!("the robot was told {sent} times to stop, and is not heard any more"),
        }))
    }

    fn wheels_stand(&self) -> bool {
        self.host.last_report().is_some_and(|report| report.telemetry.rpm == [0; 4])
    }

    /// One round; what the host has to tell is asked of it where it is needed.
    fn round(&mut self, until: Instant) -> Result<(), Failure> {
        self.port.round(&mut self.host, until)?;
        while self.host.poll_event().is_some() {}
        Ok(())
    }

    fn say_report(&mut self, what: &str) -> Result<(), Failure> {
        let Some(report) = self.host.last_report() else { return Ok(()) };
        let (now, lost) = (report.telemetry, self.host.statistics().reports_lost);
        let [front_left, front_right, back_left, back_right] = now.rpm;
        self.say(&format!(
            "rpm {front_left:4} {front_right:4} {back_left:4} {back_right:4}  heading {:3} deg  \
             {:.1} V  {:.2} A  battery {} %  lost reports {lost}{what}",
            now.heading_deg,
            now.volts(),
            now.amperes(),
            now.battery_pct,
        ))
    }

    fn say(&mut self, what: &str) -> Result<(), Failure> {
        let seconds = (self.port.now() - self.start).as_micros() as f64 / 1e6;
        writeln!(self.out, "{seconds:7.2} s  {what}")
            .and_then(|()| self.out.flush())
            .map_err(Failure::Write)
    }
}
