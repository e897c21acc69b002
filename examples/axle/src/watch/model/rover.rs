//! A rover, as far as the traffic tells.

use axlewire::ucp::{
    Frame, Message, Telemetry,
    message::{ErrorCode, NetworkState},
};

use super::{Log, Rate, Trend};

/// Time without a message from the robot after which the link is down (ruling U10), microseconds.
const LINK_TIMEOUT: u64 = 500_000;

/// A motor command, as sent.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Command {
    pub(crate) speed: i16,
    pub(crate) turn: i16,
    pub(crate) is_lamp_on: bool,
}

/// Whether the robot is heard.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) enum Link {
    /// It was never heard.
    #[default]
    Unheard,
    Up,
    Down,
}

/// What is known of a rover.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rover {
    pub(crate) link: Link,
    pub(crate) report: Option<Telemetry>,
    pub(crate) firmware: Option<u16>,
    pub(crate) reports: Rate,
    /// Reports missing in the count of their indices (ruling U9).
    pub(crate) lost: u64,
    pub(crate) command: Option<Command>,
    pub(crate) commands: Rate,
    pub(crate) pings: u64,
    pub(crate) pongs: u64,
    /// Time from the last answered ping to its pong, microseconds.
    pub(crate) round_trip: Option<u64>,
    /// The last step of a calibration.
    pub(crate) calibration: Option<String>,
    pub(crate) network: Option<NetworkState>,
    /// Mean speed of the wheels.
    pub(crate) trend: Trend,
    last_index: Option<u8>,
    pinged_at: Option<u64>,
    heard_at: u64,
}

impl Rover {
    pub(super) fn frame(&mut self, frame: &Frame, at: u64, log: &mut Log) {
        let message = frame.message();
        if message.is_from_host() == Some(false) {
            self.heard_at = at;
            if self.link != Link::Up {
                let before = core::mem::replace(&mut self.link, Link::Up);
                let again = if before == Link::Down { " again" } else { "" };
                log.event(at, None, format!("the robot is heard{again}"));
            }
        }
        match &message {
            Message::Report(report) => {
                self.count(frame.index(), at, log);
                self.report = Some(report.telemetry());
                if report.version() != self.firmware
                    && let Some(version) = report.version()
                {
                    log.event(at, None, format!("firmware {version}"));
                    self.firmware = Some(version);
                }
            }
            Message::MotorControl(command) => {
                self.commands.count += 1;
                let (speed, turn) = (command.speed(), command.angular());
                self.command = Some(Command { speed, turn, is_lamp_on: command.lamp_is_on() });
                if command.starts_update() {
                    log.event(at, None, format!("{message}"));
                }
            }
            Message::Ping(_) => {
                self.pings += 1;
                self.pinged_at = Some(at);
            }
            Message::Pong(pong) => {
                self.pongs += 1;
                let since = self.pinged_at.take();
                self.round_trip = since.map(|since| at.saturating_sub(since)).or(self.round_trip);
                if pong.err() != ErrorCode::Fine {
                    log.event(at, None, format!("{message}"));
                }
            }
            Message::SetNetworkState(set) => self.set_network(set.state(), at, log),
            Message::SetNetworkStateWide(set) => self.set_network(set.state(), at, log),
            Message::CalibrationStart(_)
            | Message::CalibrationStartAck(_)
            | Message::CalibrationEnd(_)
            | Message::CalibrationEndAck(_)
            | Message::ImuBias(_)
            | Message::MagBias(_) => {
                self.calibration = Some(message.name().replace('_', " "));
                log.event(at, None, format!("{message}"));
            }
            _ => log.event(at, None, format!("{message}")),
        }
    }

    fn set_network(&mut self, state: NetworkState, at: u64, log: &mut Log) {
        if self.network != Some(state) {
            log.event(at, None, format!("network {state}"));
        }
        self.network = Some(state);
    }

    /// Counts a report and those missing in front of it.
    fn count(&mut self, index: u8, at: u64, log: &mut Log) {
        self.reports.count += 1;
        let lost = match self.last_index.replace(index) {
            // The same one again.
            Some(last) if last == index => 0,
            Some(last) => index.wrapping_sub(last).wrapping_sub(1),
            None => 0,
        };
        if lost > 0 {
            self.lost += u64::from(lost);
            let reports = if lost == 1 { "report" } else { "reports" };
            log.event(at, None, format!("{lost} {reports} lost, by their indices"));
        }
    }

    pub(super) fn tick(&mut self, now: u64, log: &mut Log) {
        if self.link == Link::Up && now.saturating_sub(self.heard_at) > LINK_TIMEOUT {
            self.link = Link::Down;
            log.event(now, None, "the robot is no longer heard".to_owned());
        }
        let report = self.report.filter(|_| self.link == Link::Up);
        let mean = |report: Telemetry| {
            report.rpm.into_iter().map(f64::from).sum::<f64>() / report.rpm.len() as f64
        };
        self.trend.tick(report.map(mean), now);
    }

    pub(super) fn measure(&mut self, seconds: f64) {
        self.reports.measure(seconds);
        self.commands.measure(seconds);
    }
}
