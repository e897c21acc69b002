//! A rover.

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

use super::{Faults, pty::Pty, say};
use crate::{EXIT_CODES, failure::Failure, session::Session, signals::Signals};

/// Simulate a rover, which reports, drives as commanded, and stops without commands
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(super) struct Args {
    #[command(flatten)]
    faults: Faults,
}

/// Interval between two checks of the rover, which reports every 20 ms.
const STEP: Duration = Duration::from_millis(10);

/// Runs the subcommand.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let mut session =
        Session::new(Pty::open(args.faults)?, |now| Robot::new(RobotConfig::default(), now));
    let (mut rover, mut last) = (Rover::new(), session.now());
    let mut is_moving = false;
    while !signals.is_raised() {
        let until = session.now() + STEP;
        let mut next = session.round(until)?;
        let now = session.now();
        let robot = session.role_mut();
        while let Some(event) = next {
            if let Some(line) = react(robot, event, now) {
                say(now, &line)?;
            }
            next = robot.poll_event();
        }
        rover.step(now - last);
        rover.command(&robot.command(now));
        robot.set_telemetry(&rover.telemetry(), now);
        last = now;

        let was_moving = is_moving;
        is_moving = rover.telemetry().rpm != [0; 4];
        if is_moving && !was_moving {
            say(now, "moving")?;
        }
        if was_moving && !is_moving {
            let (way, heading) = (rover.distance_m(), rover.heading_deg());
            say(now, &format!("at rest after {way:.2} m, heading {heading:.0} deg"))?;
        }
    }
    let seen = session.role().statistics();
    let line =
        format!("{} commands, {} pings, {} reports", seen.commands, seen.pings, seen.reports);
    say(last, &line)
}

/// Does what the host requests, and returns a line about it.
fn react(robot: &mut Robot, event: RobotEvent, now: Instant) -> Option<String> {
    Some(match event {
        RobotEvent::Motor(command) => describe(&command),
        RobotEvent::Watchdog => "watchdog: no command for 500 ms".to_owned(),
        RobotEvent::CalibrationStart { kind, repeated: false } => {
            format!("calibration begins: {kind:?}")
        }
        RobotEvent::CalibrationEnd(kind) => {
            // A perfect sensor has no bias.
            match kind {
                CalibrationKind::Imu => {
                    robot.calibration_result_imu(ImuBias::new([0; 3], [0; 3]), now);
                }
                CalibrationKind::Magnetometer => {
                    robot.calibration_result_mag(MagBias::new([0; 3]), now);
                }
                CalibrationKind::Other(_) => {}
            }
            format!("calibration ends: {kind:?}")
        }
        RobotEvent::NetworkState(state) => format!("network state: {state:?}"),
        RobotEvent::UpdateRequested { version, .. } => {
            format!("firmware update to version {version} requested and ignored")
        }
        _ => return None,
    })
}

fn describe(command: &MotorControl) -> String {
    let (speed, turn) = (command.speed(), command.angular());
    let side = if turn < 0 {
        " left"
    } else if turn > 0 {
        " right"
    } else {
        ""
    };
    let lamp = if command.front_led() == 0 { "off" } else { "on" };
    format!("command: speed {speed} %, turn {} %{side}, lamp {lamp}", turn.abs())
}
