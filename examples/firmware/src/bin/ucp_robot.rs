//! The robot side of a rover link, with a simulated rover.
//!
//! Answers pings, drives as commanded, stops 500 ms after the last command, reports 50 times a
//! second, calibrates, switches its lamp, and refuses updates. Text port: one line per second, and
//! one for each received byte.

#![no_std]
#![no_main]

use axlewire::{
    drive::{Clock as _, Driver},
    time::{Duration, Instant},
    ucp::{
        self, Robot,
        message::{CalibrationKind, ImuBias, MagBias, NetworkState, OtaStatus},
        robot::{RobotEvent, RobotStatistics, UpdateSource},
    },
};
use axlewire_firmware::{
    board::Board, clock::milliseconds, on_panic, rover::Rover, serve_usarts, text_line::TextLine,
};
use embedded_hal::digital::OutputPin;

on_panic!();
serve_usarts!();

/// Step of the rover model; the telemetry changes with it.
const STEP: Duration = Duration::from_millis(10);

/// Interval between lines of text.
const REPORT: Duration = Duration::from_secs(1);

/// Results of a calibration; the model has no real biases.
const ACC_BIAS: [i16; 3] = [12, -7, 3];
const GYRO_BIAS: [i16; 3] = [-2, 4, 1];
const MAG_BIAS: [i16; 3] = [150, -80, 25];

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(board) = Board::take(ucp::BAUD) {
        run(board);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

fn run(mut board: Board) {
    let config = board.configs.robot();
    let mut last = board.clock.now();
    let mut report_at = last;
    let mut driver = Driver::new(Robot::new(config, last), board.bus, board.clock);
    let mut rover = Rover::new();
    let mut shown = Shown::default();
    driver.role_mut().set_telemetry(&rover.telemetry(), last);
    loop {
        // Commands act within a step; requests of the host are answered in here, at once. The port
        // cannot fail. A report is 44 bytes and takes 4 ms to send; the interrupt receives bytes
        // meanwhile.
        let until = last + STEP;
        while let Ok(Some(event)) = driver.next_event(until - driver.now()) {
            let now = driver.now();
            shown.answer(driver.role_mut(), event, now);
            if now >= until {
                break;
            }
        }
        let now = driver.now();
        let robot = driver.role_mut();
        let command = robot.command(now);
        rover.command(&command);
        rover.step(now - last);
        robot.set_telemetry(&rover.telemetry(), now);
        last = now;
        // The pin cannot fail either.
        let Ok(()) = board.lamp.set_state((command.front_led() != 0).into());

        let asked = board.text.poll_byte().is_some();
        if asked || now >= report_at {
            let mut line = TextLine::new("robot");
            report(&mut line, robot, &rover, &shown, now);
            line.count("stack", board.stack.used()).count("ms", milliseconds(now));
            // Requests that come faster than lines can be sent are dropped.
            board.text.try_send(line.end());
            if !asked {
                report_at = now + REPORT;
            }
        }
    }
}

/// Requests of the host other than driving.
#[derive(Default)]
struct Shown {
    network: u32,
    calibrations: u32,
    biases: u32,
    updates_refused: u32,
}

impl Shown {
    fn answer(&mut self, robot: &mut Robot, event: RobotEvent, now: Instant) {
        let count = |counter: &mut u32| *counter = counter.wrapping_add(1);
        match event {
            RobotEvent::CalibrationEnd(CalibrationKind::Imu) => {
                count(&mut self.calibrations);
                robot.calibration_result_imu(ImuBias::new(ACC_BIAS, GYRO_BIAS), now);
            }
            RobotEvent::CalibrationEnd(CalibrationKind::Magnetometer) => {
                count(&mut self.calibrations);
                robot.calibration_result_mag(MagBias::new(MAG_BIAS), now);
            }
            RobotEvent::UpdateRequested { by, .. } => {
                count(&mut self.updates_refused);
                // This firmware has no boot loader. A request by motor command gets no answer.
                if by == UpdateSource::Request {
                    robot.answer_update(OtaStatus::Forbidden, now);
                }
            }
            RobotEvent::NetworkState(state) => self.network = NetworkState::into(state),
            RobotEvent::Biases(_) => count(&mut self.biases),
            _ => {}
        }
    }
}

/// All values that a test or a user may want to see.
fn report(line: &mut TextLine, robot: &Robot, rover: &Rover, shown: &Shown, now: Instant) {
    let (command, (left, right)) = (robot.command(now), rover.rpm());
    let RobotStatistics { commands, watchdog, pings, pongs, reports, reports_skipped, .. } =
        *robot.statistics();
    line.number("speed", command.speed().into())
        .number("angular", command.angular().into())
        .count("lamp", (command.front_led() != 0).into())
        .number("left_rpm", left.into())
        .number("right_rpm", right.into())
        .count("commands", commands)
        .count("stops", watchdog)
        .count("pings", pings)
        .count("pongs", pongs)
        .count("reports", reports)
        .count("late", reports_skipped)
        .count("network", shown.network)
        .count("calibrations", shown.calibrations)
        .count("biases", shown.biases)
        .count("updates_refused", shown.updates_refused)
        .count("skipped", robot.counters().skipped() as u32)
        .bus_losses();
}
