//! A robot under any calls, bytes and times, with any settings: it does not move without a command,
//! and reports what it was told, in its layout.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Arrival, Endpoint},
    time::{Duration, Instant},
    ucp::{
        Frame, Message, Robot, Telemetry,
        message::{MagBias, Report},
        robot::{ReportLayout, RobotConfig},
    },
};

use super::{
    Clock, Tally, check_account, oracle, raw, serve,
    ucp_frames::{from_host, from_robot, imu, is_to_robot},
    unsent,
};

/// The robot of a rover.
pub(crate) fn ucp_robot(data: &[u8], tally: &mut Tally) {
    let _ = robot(&mut Unstructured::new(data), tally);
}

fn config(u: &mut Unstructured<'_>) -> Result<RobotConfig> {
    let mut config =
        if u.arbitrary()? { RobotConfig::direct() } else { RobotConfig::usb_adapter() };
    if u.arbitrary()? {
        config.layout = ReportLayout::Document;
    }
    config.watchdog = Duration::from_millis(*u.choose(&[500, 0, 40])?);
    config.report_period = Duration::from_millis(*u.choose(&[20, 0, 1000])?);
    config.result_period = Duration::from_millis(*u.choose(&[1000, 0])?);
    config.bias_request_period = *u.choose(&[Some(Duration::from_millis(1000)), None])?;
    config.baud = *u.choose(&[115_200, 9600, 0])?;
    Ok(config)
}

fn robot(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let config = config(u)?;
    let mut clock = Clock::new(u)?;
    let mut robot = Robot::new(config, clock.0);
    let (mut history, mut given) = (History::default(), 0);
    let mut telemetry: Option<Telemetry> = None;
    while !u.is_empty() {
        let now = clock.pass(u)?;
        let mut input = Vec::new();
        let action = u.int_in_range(0..=10_u8)?;
        match action {
            0 => input = raw(u)?.to_vec(),
            1 | 2 => input = from_host(u)?,
            3 => input = from_robot(u)?,
            4 => {
                let measured = u.arbitrary()?;
                robot.set_telemetry(&measured, now);
                telemetry = Some(measured);
            }
            5 => robot.calibration_result_imu(imu(u)?, now),
            6 => robot.calibration_result_mag(MagBias::new(u.arbitrary()?), now),
            7 => drop(robot.answer_update(u.arbitrary()?, now)),
            8 => drop(robot.abort_calibration()),
            9 => robot.handle_transmit(unsent(u)?, now),
            _ => {
                // Bytes that have waited are as old as they may be.
                let since = now;
                let now = clock.pass(u)?;
                let old = from_host(u)?;
                given += old.len() as u64;
                history.take(&old, since);
                robot.handle_input(&old, Arrival::Between { since, now });
            }
        }
        let now = now.max(clock.0);
        given += input.len() as u64;
        history.take(&input, now);
        robot.handle_input(&input, now);
        for packet in serve(&mut robot, now, |_| {}) {
            let frame = Frame::parse(&packet).expect("a good frame");
            match frame.message() {
                Message::Report(report) => check_report(report, telemetry, config),
                message => assert!(!is_to_robot(&message), "{message:?} from a robot"),
            }
        }
        let doing = robot.command(now);
        let motion = (doing.speed(), doing.angular());
        let limit = config.watchdog.max(Duration::from_millis(1));
        assert!(
            motion == (0, 0) || history.has_commanded(motion, limit, now),
            "{motion:?} at {now:?} without a command in the last {limit:?}"
        );
        check_account(robot.counters(), given, 64);
        tally.did(action);
    }
    Ok(())
}

fn check_report(report: Report<'_>, told: Option<Telemetry>, config: RobotConfig) {
    assert_eq!(Some(report.telemetry()), told, "a report of something else");
    match (config.layout, report) {
        (ReportLayout::Firmware { version }, Report::Firmware(report)) => {
            assert_eq!(report.version(), version);
        }
        (ReportLayout::Document, Report::Document(_)) => {}
        (layout, report) => panic!("{report:?} for {layout:?}"),
    }
}

/// The motor commands that the input may contain, at any offset.
#[derive(Default)]
struct History {
    tail: Vec<u8>,
    commands: Vec<(Instant, (i16, i16))>,
}

impl History {
    fn take(&mut self, input: &[u8], at: Instant) {
        for &byte in input {
            self.tail.push(byte);
            let start = self.tail.len().saturating_sub(24);
            self.tail.drain(..start);
            let (body, crc) = self.tail.split_at(self.tail.len().saturating_sub(2));
            let is_motor = body.len() == 22 && body[..5] == [0xFD, 0xFF, 20, 0, 2];
            if is_motor && oracle::crc(body).to_le_bytes() == crc {
                let percent =
                    |at: usize| i16::from_le_bytes([body[at], body[at + 1]]).clamp(-100, 100);
                self.commands.push((at, (percent(6), percent(8))));
            }
        }
    }

    /// Whether a complete motor command for this motion has arrived within `limit`.
    fn has_commanded(&self, motion: (i16, i16), limit: Duration, now: Instant) -> bool {
        self.commands.iter().rev().any(|&(at, told)| now - at < limit && told == motion)
    }
}
