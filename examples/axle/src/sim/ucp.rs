//! A rover.

use std::fmt;

use axlewire::{
    endpoint::Endpoint,
    sim::Rover,
    time::{Duration, Instant},
    ucp::{
        MotorControl, Robot,
        message::{CalibrationKind, ImuBias, MagBias},
        robot::{RobotConfig, RobotEvent},
    },
};
use serde::Serialize;

use super::stage::{Stage, StageArgs};
use crate::{failure::Failure, help::EXIT_CODES, session::Session};

/// Simulate a rover, which reports, drives as commanded, and stops without commands
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(super) struct Args {
    /// Never ask the host for biases, for hosts that cannot take that message, such as the
    /// vendor's Python SDK; without this, the rover asks every second until it gets them
    #[arg(long)]
    no_bias_requests: bool,

    #[command(flatten)]
    stage: StageArgs,
}

/// Interval between two checks of the rover, which reports every 20 ms.
const STEP: Duration = Duration::from_millis(10);

/// Runs the subcommand.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let (mut stage, line) = Stage::open(&args.stage)?;
    let mut config = RobotConfig::default();
    if args.no_bias_requests {
        config.bias_request_period = None;
    }
    let mut session = Session::new(line, |now| Robot::new(config, now));
    let mut moved = Moved { rover: Rover::new(), until: session.now() };
    let mut is_moving = false;
    while stage.goes_on(session.now())? {
        let until = session.now() + STEP;
        let mut next = session.round(until)?;
        let now = session.now();
        let robot = session.role_mut();
        while let Some(event) = next {
            if let Some(event) = react(robot, event, now) {
                stage.say(now, &event)?;
            }
            next = robot.poll_event();
        }
        moved.advance(robot, now);

        let (rover, was_moving) = (&moved.rover, is_moving);
        is_moving = rover.telemetry().rpm != [0; 4];
        if is_moving && !was_moving {
            stage.say(now, &Event::Moving)?;
        }
        if was_moving && !is_moving {
            let (distance_m, heading_deg) = (rover.distance_m(), rover.heading_deg());
            stage.say(now, &Event::AtRest { distance_m, heading_deg })?;
        }
    }
    let seen = session.role().statistics();
    let (commands, pings, reports) = (seen.commands, seen.pings, seen.reports);
    stage.say(moved.until, &Event::Statistics { commands, pings, reports })
}

/// The rover as it was at this time.
struct Moved {
    rover: Rover,
    until: Instant,
}

impl Moved {
    /// Goes on as commanded until `now`, and takes the command of that moment.
    fn advance(&mut self, robot: &mut Robot, now: Instant) {
        self.rover.step(now - self.until);
        self.rover.command(&robot.command(now));
        robot.set_telemetry(&self.rover.telemetry(), now);
        self.until = now;
    }
}

/// What happens to the rover.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    Command { speed: i16, angular: i16, front_led: i16 },
    Watchdog,
    CalibrationStart { kind: String },
    CalibrationEnd { kind: String },
    NetworkState { state: String },
    UpdateRequest { version: i16 },
    Moving,
    AtRest { distance_m: f64, heading_deg: f64 },
    Statistics { commands: u32, pings: u32, reports: u32 },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command { speed, angular, front_led } => {
                let side = match angular {
                    ..=-1 => " left",
                    0 => "",
                    1.. => " right",
                };
                let lamp = if *front_led == 0 { "off" } else { "on" };
                write!(f, "command: speed {speed} %, turn {} %{side}, lamp {lamp}", angular.abs())
            }
            Self::Watchdog => f.write_str("watchdog: no command for 500 ms"),
            Self::CalibrationStart { kind } => write!(f, "calibration begins: {kind}"),
            Self::CalibrationEnd { kind } => write!(f, "calibration ends: {kind}"),
            Self::NetworkState { state } => write!(f, "network state: {state}"),
            Self::UpdateRequest { version } => {
                write!(f, "firmware update to version {version} requested and ignored")
            }
            Self::Moving => f.write_str("moving"),
            Self::AtRest { distance_m, heading_deg } => {
                write!(f, "at rest after {distance_m:.2} m, heading {heading_deg:.0} deg")
            }
            Self::Statistics { commands, pings, reports } => {
                write!(f, "{commands} commands, {pings} pings, {reports} reports")
            }
        }
    }
}

/// The results of a calibration: some biases, so that they can be told from none.
const IMU_BIAS: ([i16; 3], [i16; 3]) = ([12, -7, 30], [4, -2, 1]);
const MAG_BIAS: [i16; 3] = [105, -48, 260];

/// Does what the host requests, and returns what to print about it.
fn react(robot: &mut Robot, event: RobotEvent, now: Instant) -> Option<Event> {
    Some(match event {
        RobotEvent::Motor(command) => Event::from(&command),
        RobotEvent::Watchdog => Event::Watchdog,
        RobotEvent::CalibrationStart { kind, repeated: false } => {
            Event::CalibrationStart { kind: kind.to_string() }
        }
        RobotEvent::CalibrationEnd(kind) => {
            match kind {
                CalibrationKind::Imu => {
                    let (accelerometer, gyroscope) = IMU_BIAS;
                    robot.calibration_result_imu(ImuBias::new(accelerometer, gyroscope), now);
                }
                CalibrationKind::Magnetometer => {
                    robot.calibration_result_mag(MagBias::new(MAG_BIAS), now);
                }
                CalibrationKind::Other(_) => {}
            }
            Event::CalibrationEnd { kind: kind.to_string() }
        }
        RobotEvent::NetworkState(state) => Event::NetworkState { state: state.to_string() },
        RobotEvent::UpdateRequested { version, .. } => Event::UpdateRequest { version },
        _ => return None,
    })
}

impl From<&MotorControl> for Event {
    fn from(command: &MotorControl) -> Self {
        let (speed, angular) = (command.speed(), command.angular());
        Self::Command { speed, angular, front_led: command.front_led() }
    }
}

#[cfg(test)]
mod tests;
