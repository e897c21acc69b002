//! `axle calibrate`: calibrates sensors of a rover.

use std::{
    fmt, io,
    sync::mpsc::{self, Receiver},
    thread,
};

use axlewire::{
    time::{Duration, Instant},
    ucp::{
        host::{CalibrationFailure, CalibrationStep, FailureCause, HostEvent},
        message::{CalibrationKind, ImuBias, MagBias},
    },
};
use serde::Serialize;

use crate::{
    args,
    failure::Failure,
    help::EXIT_CODES,
    report::Form,
    rover::{CALL_PERIOD, Rover},
    send::Kind,
    signals::Signals,
    teller::Teller,
};

/// Calibrate sensors of a rover
///
/// Starts the calibration, says what to do, ends it after --for or when Enter is pressed, and
/// prints the biases. On Ctrl-C the calibration is ended too, and the exit code is 1. The biases
/// are not kept here: give them to the program that answers when the robot boots, or send them with
/// `axle send ucp biases`.
///
/// The robot does not move by itself, and this subcommand does not move it: the first frame is a
/// stop, and stops are repeated every 0.1 s (ruling U16), so a rover that is driven by another
/// program stops, and its lamp goes off. For the magnetometer, turn it by hand.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// What to calibrate
    #[arg(short, long, value_enum)]
    kind: Kind,

    /// Duration, seconds, at least 1.2; by default, until Enter
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    micros: Option<u64>,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

/// Longest wait for the result: the robot repeats it every second until it is then acknowledged.
const RESULT_PATIENCE: Duration = Duration::from_secs(5);

/// What happens.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    Started { kind: String, what_to_do: &'static str },
    Ended { kind: String },
    ImuBias { acc: [i16; 3], gyro: [i16; 3] },
    MagBias { mag: [i16; 3] },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started { kind, what_to_do } => {
                write!(f, "calibration of the {kind} has begun: {what_to_do}")
            }
            Self::Ended { kind } => write!(f, "calibration of the {kind} has ended"),
            Self::ImuBias { acc: [ax, ay, az], gyro: [gx, gy, gz] } => {
                write!(f, "biases: accelerometer {ax} {ay} {az}, gyroscope {gx} {gy} {gz}")
            }
            Self::MagBias { mag: [x, y, z] } => write!(f, "biases: magnetometer {x} {y} {z}"),
        }
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    // The end of the calibration is bounded.
    let signals = Signals::listen_gently()?;
    let mut rover = Rover::open(&args.line)?;
    if !rover.find(|| signals.is_raised())? {
        return Err(Failure::Failed("interrupted before the calibration began".to_owned()));
    }
    let start = rover.now();
    let form = Form::of(args.json);
    let kind = args.kind.kind();
    let teller = Teller::new();
    let mut calibration =
        Calibration { rover, start, form, teller, kind, result: None, earlier: 0, taken: 0 };
    let calibrated = calibration.run(args, &signals);
    calibrated.and(calibration.teller.finish()).and_then(|()| calibration.rover.check_recording())
}

struct Calibration {
    rover: Rover,
    start: Instant,
    form: Form,
    teller: Teller,
    kind: CalibrationKind,
    /// The latest result.
    result: Option<Event>,
    /// Number of results that had come before the end was asked for. They are of an earlier
    /// calibration: robots repeat theirs every second until it is then acknowledged.
    earlier: u32,
    /// Number of results that were no repetition.
    taken: u32,
}

/// Shortest time between start and end: for a result that the robot still repeats, which
/// is then acknowledged.
const SHORTEST_US: u64 = 1_200_000;

impl Calibration {
    fn run(&mut self, args: &Args, signals: &Signals) -> Result<(), Failure> {
        let started = self.request(CalibrationStep::Start);
        let told = started.and_then(|()| self.say_started(args));
        let listened = told.and_then(|()| self.listen(args, signals));
        // In any case, the robot is told that the calibration is over: it may have begun even if
        // its answer was lost.
        self.earlier = self.results();
        let ended = self.request(CalibrationStep::End);
        listened?;
        ended?;
        if !signals.is_raised() {
            self.say(&Event::Ended { kind: self.kind.to_string() })?;
            if let Some(result) = self.result(signals)? {
                return self.say(&result);
            }
        }
        Err(Failure::Failed("interrupted: the calibration was ended".to_owned()))
    }

    fn say(&mut self, event: &Event) -> Result<(), Failure> {
        let micros = self.rover.now().as_micros().saturating_sub(self.start.as_micros());
        self.teller.say(self.form.line(micros, event))
    }

    fn say_started(&mut self, args: &Args) -> Result<(), Failure> {
        let kind = self.kind;
        let what_to_do = match (kind, args.micros.is_some()) {
            (CalibrationKind::Magnetometer, true) => "turn the robot by hand until the time is up",
            (CalibrationKind::Magnetometer, false) => "turn the robot by hand, then press Enter",
            (_, true) => "keep the robot still until the time is up",
            (_, false) => "keep the robot still, then press Enter",
        };
        self.say(&Event::Started { kind: kind.to_string(), what_to_do })
    }

    /// Number of results received.
    fn results(&self) -> u32 {
        self.taken.saturating_add(self.rover.host().statistics().results_repeated)
    }

    /// Runs one round, and keeps a result.
    fn round(&mut self) -> Result<(), Failure> {
        let until = self.rover.now() + CALL_PERIOD;
        let mut found = None;
        let kind = self.kind;
        let round = self.rover.round_with(until, |event| match event {
            HostEvent::ImuBias(bias) if kind == CalibrationKind::Imu => {
                found = Some(Event::of_imu(bias));
            }
            HostEvent::MagBias(bias) if kind == CalibrationKind::Magnetometer => {
                found = Some(Event::of_mag(bias));
            }
            _ => {}
        });
        if found.is_some() {
            (self.result, self.taken) = (found, self.taken.saturating_add(1));
        }
        round
    }

    /// Asks the robot to begin or to end, and waits for its answer.
    fn request(&mut self, step: CalibrationStep) -> Result<(), Failure> {
        let (kind, now) = (self.kind, self.rover.now());
        let host = self.rover.host_mut();
        match step {
            CalibrationStep::Start => host.start_calibration(kind, now),
            CalibrationStep::End => host.end_calibration(kind, now),
        }
        .map_err(|error| Failure::Failed(error.to_string()))?;
        loop {
            match self.rover.host().calibration_outcome() {
                Some(Ok(())) => return Ok(()),
                Some(Err(failure)) => {
                    let CalibrationFailure { kind, step, cause, attempts, .. } = failure;
                    return Err(Failure::Failed(describe(kind, step, cause, attempts)));
                }
                None => self.round()?,
            }
        }
    }

    /// Waits until the time is up, Enter is pressed, or a signal comes.
    fn listen(&mut self, args: &Args, signals: &Signals) -> Result<(), Failure> {
        let begin = self.rover.now().as_micros();
        let soonest = Instant::from_micros(begin + SHORTEST_US);
        let end = args.micros.map(|micros| Instant::from_micros(begin + micros));
        let enter = if end.is_none() { Some(enter()) } else { None };
        let is_pressed = || enter.as_ref().is_some_and(|enter| enter.try_recv().is_ok());
        let mut is_over = false;
        while !signals.is_raised() {
            if is_over && self.rover.now() >= soonest {
                break;
            }
            is_over |= is_pressed() || end.is_some_and(|end| self.rover.now() >= end);
            self.round()?;
        }
        Ok(())
    }

    /// Waits for the result; `None` if a signal comes first.
    fn result(&mut self, signals: &Signals) -> Result<Option<Event>, Failure> {
        let end = self.rover.now() + RESULT_PATIENCE;
        while self.rover.now() < end {
            if signals.is_raised() {
                return Ok(None);
            }
            // The same numbers once more are a result too.
            match self.result.take() {
                Some(result) if self.results() > self.earlier => return Ok(Some(result)),
                result => self.result = result,
            }
            self.round()?;
        }
        let seconds = RESULT_PATIENCE.as_micros() / 1_000_000;
        Err(Failure::Failed(format!("the robot has sent no result for {seconds} s")))
    }
}

impl Event {
    fn of_imu(bias: &ImuBias) -> Self {
        Self::ImuBias { acc: bias.acc(), gyro: bias.gyro() }
    }

    fn of_mag(bias: &MagBias) -> Self {
        Self::MagBias { mag: bias.mag() }
    }
}

/// Gets a message when Enter is pressed. The end of the input does not count.
fn enter() -> Receiver<()> {
    let (pressed, enter) = mpsc::channel();
    thread::spawn(move || {
        let mut line = String::new();
        if io::stdin().read_line(&mut line).is_ok_and(|count| count > 0) {
            // Fails only if the receiver is gone.
            let _ = pressed.send(());
        }
    });
    enter
}

fn describe(
    kind: CalibrationKind,
    step: CalibrationStep,
    cause: FailureCause,
    attempts: u8,
) -> String {
    let step = match step {
        CalibrationStep::Start => "begin",
        CalibrationStep::End => "end",
    };
    let cause = match cause {
        FailureCause::Refused(code) => format!("the robot refuses ({code})"),
        _ => "the robot does not answer".to_owned(),
    };
    format!("the calibration of the {kind} does not {step}: {cause}, asked {attempts} times")
}

#[cfg(all(test, unix))]
mod tests {
    use axlewire::ucp::message::ErrorCode;

    use super::*;
    use crate::{args::PortArgs, played};

    /// A calibration of the IMU, on a rover that answers.
    fn calibration() -> Calibration {
        let mut rover = Rover::on(played::rover(|_| {}).line, &PortArgs::new(None));
        assert!(rover.find(|| false).unwrap());
        let start = rover.now();
        let (form, teller, kind) = (Form::of(false), Teller::new(), CalibrationKind::Imu);
        Calibration { rover, start, form, teller, kind, result: None, earlier: 0, taken: 0 }
    }

    #[test]
    fn a_result_that_does_not_come_is_told_after_five_seconds() {
        let (mut calibration, signals) = (calibration(), Signals::none());
        let begin = calibration.rover.now();
        let Err(Failure::Failed(told)) = calibration.result(&signals) else { panic!("a result") };
        assert_eq!(told, "the robot has sent no result for 5 s");
        assert!(calibration.rover.now() - begin >= RESULT_PATIENCE);
        signals.raise();
        assert!(calibration.result(&signals).unwrap().is_none());
    }

    #[test]
    fn a_failure_is_told_with_the_step_the_cause_and_the_attempts() {
        let (imu, mag) = (CalibrationKind::Imu, CalibrationKind::Magnetometer);
        let refused = FailureCause::Refused(ErrorCode::Damaged);
        let told = describe(imu, CalibrationStep::Start, refused, 3);
        let calibration = "the calibration of the IMU does not begin";
        assert_eq!(told, format!("{calibration}: the robot refuses (damaged), asked 3 times"));
        let told = describe(mag, CalibrationStep::End, FailureCause::NoAnswer, 5);
        let calibration = "the calibration of the magnetometer does not end";
        assert_eq!(told, format!("{calibration}: the robot does not answer, asked 5 times"));
    }
}
