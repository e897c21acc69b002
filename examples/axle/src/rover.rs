//! A rover on a port, with its host; shared by `drive` and `stop`.

use std::time::Duration as Span;

use axlewire::{
    error::EncodeError,
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl,
        host::{COAST, HostConfig, HostEvent, HostStatistics, Link, STILL_REPORTS, StopProgress},
    },
};

use crate::{
    args::{self, Protocol},
    clock,
    failure::Failure,
    line::{FAILURE_PAUSE, Line},
    session::Session,
};

mod pings;
use pings::{LONGEST_TRIP, Pings};

/// Time allowed for a robot to be heard for the first time.
const LINK_PATIENCE: Duration = Duration::from_secs(2);

/// Time allowed for the wheels to come to rest after the first stop, and for the average that the
/// robot reports to show it.
const STOP_PATIENCE: Span = Span::from_millis(4000);

/// Longest interval between two calls of the host: well under its dead-man timeout of 500 ms.
pub(crate) const CALL_PERIOD: Duration = Duration::from_millis(50);

/// Consequence of a lost port for a moving robot.
pub(crate) const OUT_OF_REACH: &str = "the robot can no longer be told to stop: it may be moving until 500 ms after the last byte \
     on its line";

/// A port and the host on it.
pub(crate) struct Rover {
    session: Session<Host>,
    /// The host's dead-man has stopped the robot.
    pub(crate) has_dead_man_fired: bool,
    pings: Pings,
    /// Others have sent pings on this line.
    has_others: bool,
}

impl Rover {
    pub(crate) fn open(line: &args::PortArgs) -> Result<Self, Failure> {
        Self::open_with(line, HostConfig::default())
    }

    pub(crate) fn open_with(args: &args::PortArgs, config: HostConfig) -> Result<Self, Failure> {
        Ok(Self::with(config, Line::open(args, Protocol::Ucp)?, args))
    }

    /// A rover on an open line.
    pub(crate) fn on(line: Line, args: &args::PortArgs) -> Self {
        Self::with(HostConfig::default(), line, args)
    }

    /// The same with these settings, but for the speed, which is that of the line.
    pub(crate) fn with(config: HostConfig, line: Line, args: &args::PortArgs) -> Self {
        let mut config = config;
        config.baud = args.baud_for(Protocol::Ucp);
        let session = Session::new(line, |now| Host::new(config, now));
        Self { session, has_dead_man_fired: false, pings: Pings::default(), has_others: false }
    }

    /// Tells that others have sent pings on this line.
    pub(crate) const fn others_have_pinged(&mut self) {
        self.has_others = true;
    }

    pub(crate) fn now(&mut self) -> Instant {
        self.session.now()
    }

    /// Ends the recording, if there is one, for use while nothing moves; fails if it is incomplete.
    pub(crate) fn check_recording(&self) -> Result<(), Failure> {
        self.session.check_recording()
    }

    pub(crate) const fn host(&self) -> &Host {
        self.session.role()
    }

    pub(crate) const fn host_mut(&mut self) -> &mut Host {
        self.session.role_mut()
    }

    /// Whether the robot has been told what to do (ruling U16), and something else may be said.
    pub(crate) fn is_told(&self) -> bool {
        let is_stop = self.host().command().is_some_and(|command| command.stands_still());
        self.session.is_clear() && (!is_stop || self.host().is_stop_sent())
    }

    /// Sends a frame that is not the host's; `false` if it did not leave whole.
    pub(crate) fn interject(&mut self, frame: &[u8]) -> Result<bool, Failure> {
        self.session.interject(frame)
    }

    /// Fails if the robot is no longer heard (ruling U10).
    pub(crate) fn check_heard(&self) -> Result<(), Failure> {
        match self.host().link() {
            Link::Down => Err(Failure::Failed("the robot is no longer heard".to_owned())),
            _ => Ok(()),
        }
    }

    /// Waits until the robot is heard; `false` if `is_over` returns `true` first.
    pub(crate) fn find(&mut self, is_over: impl Fn() -> bool) -> Result<bool, Failure> {
        let end = self.now() + LINK_PATIENCE;
        while self.host().link() != Link::Up && !is_over() {
            if self.now() >= end {
                let (path, seconds) = (self.session.path(), LINK_PATIENCE.as_micros() / 1_000_000);
                let heard = match self.host().counters().received {
                    0 => "nothing".to_owned(),
                    bytes => format!("{bytes} bytes but no message"),
                };
                return Err(Failure::Failed(format!(
                    "no robot answers on {path:?}: {heard} received in {seconds} s"
                )));
            }
            self.round(end)?;
        }
        Ok(!is_over())
    }

    /// Runs one round and handles its events.
    pub(crate) fn round(&mut self, until: Instant) -> Result<(), Failure> {
        self.round_with(until, |_| {})
    }

    /// The same, and shows the events to `react`.
    pub(crate) fn round_with(
        &mut self,
        until: Instant,
        mut react: impl FnMut(&HostEvent),
    ) -> Result<(), Failure> {
        let (mut next, result) = match self.session.round(until) {
            Ok(event) => (event, Ok(())),
            Err(failure) => (self.session.poll_event(), Err(failure)),
        };
        while let Some(event) = next {
            react(&event);
            self.has_dead_man_fired |= event == HostEvent::DeadMan;
            next = self.session.poll_event();
        }
        let now = self.now();
        self.pings.note(now, self.session.role().statistics().pings);
        result
    }

    /// A mark, to ask later whether the robot has heard everything sent before it.
    pub(crate) fn mark(&mut self) -> Mark {
        let (now, seen) = (self.now(), self.host().statistics());
        let open = self.pings.open(now, seen.pings, pongs(seen));
        Mark { at: now, pongs: pongs(seen), open: (!self.has_others).then_some(open) }
    }

    /// Whether the robot has heard what was sent up to this mark: it has answered more pings since
    /// than were open then. A pong does not say which ping it answers.
    pub(crate) fn has_heard(&self, mark: &Mark) -> bool {
        let since = pongs(self.host().statistics()).saturating_sub(mark.pongs);
        mark.open.is_some_and(|open| since > open)
    }

    /// Repeats the stop until the robot is seen to stand still (ruling U16), by reports of the time
    /// after it had heard of the stop: a network may hold back stop and reports for a while.
    /// Failures of the port and of the link do not end it early, and neither do signals.
    pub(crate) fn stop(&mut self) -> Result<(), Failure> {
        let (begin, before) = (self.now(), self.host().statistics().commands);
        let give_up = self.session.awake() + STOP_PATIENCE;
        let (mut end, mut is_in_doubt) = (give_up, false);
        // When the stop was flushed; the number of reports before the robot had heard of it, and
        // when it had.
        let (mut told, mut unheard) = (None, None);
        let average = self.host().config().rpm_average;
        self.host_mut().stop(begin);
        let failure = loop {
            let until = self.now() + CALL_PERIOD;
            let result = self.round(until);
            let (now, progress) = (self.now(), self.host().stop_progress());
            if told.is_none() && progress != StopProgress::Due {
                told = Some(self.mark());
            }
            let must_have_heard =
                |mark: &Mark| self.has_heard(mark) || now - mark.at >= LONGEST_TRIP;
            let reports = self.host().statistics().reports;
            if unheard.is_none() && told.as_ref().is_some_and(must_have_heard) {
                unheard = Some((reports, now));
            }
            let is_news = unheard.is_some_and(|(before, at)| {
                reports - before >= STILL_REPORTS.into() && now - at >= average
            });
            if result.is_ok() && is_news && progress == StopProgress::StandingStill {
                return Ok(());
            }
            let awake = self.session.awake();
            let shows_none = matches!(progress, StopProgress::StillMoving { rpm: [0, 0, 0, 0] });
            if awake >= end && shows_none && !is_in_doubt {
                // It may have restarted: its reports then say nothing for a while.
                is_in_doubt = true;
                end = awake + Span::from(COAST);
            }
            if awake >= end || result.is_err() && awake >= give_up {
                break result.err();
            }
            if result.is_err() {
                // If the port comes back, there is as much time as before.
                end = awake + STOP_PATIENCE;
                clock::sleep(FAILURE_PAUSE);
            }
        };
        if let Some(failure) = failure {
            return Err(failure.while_moving(OUT_OF_REACH));
        }
        let sent = self.host().statistics().commands.saturating_sub(before);
        let told = format!("the robot was told {sent} times to stop");
        Err(Failure::Failed(match (self.host().link(), self.host().stop_progress()) {
            (Link::Up, StopProgress::StillMoving { rpm: [0, 0, 0, 0] }) => {
                format!("{told}, but its reports do not show yet that it stands still")
            }
            (Link::Up, StopProgress::StillMoving { .. }) => {
                format!("{told}, but its wheels are still turning")
            }
            (Link::Up, _) => format!("{told}, but sends no reports: it may be moving"),
            _ => format!("{told} and is no longer heard: it may be moving"),
        }))
    }

    /// The latest report on one line.
    pub(crate) fn describe(&self) -> Option<String> {
        let report = self.host().last_report()?;
        let (now, lost) = (report.telemetry, self.host().statistics().reports_lost);
        let [front_left, front_right, back_left, back_right] = now.rpm;
        Some(format!(
            "rpm {front_left:4} {front_right:4} {back_left:4} {back_right:4}  heading {:3} deg  \
             {:.1} V  {:.2} A  battery {} %  lost reports {lost}",
            now.heading_deg,
            now.volts(),
            now.amperes(),
            now.battery_pct,
        ))
    }
}

/// A moment in the exchange with a robot.
pub(crate) struct Mark {
    at: Instant,
    /// Number of pongs by then.
    pongs: u32,
    /// The most pings whose pongs may still come; not known if others have sent some.
    open: Option<u32>,
}

/// All pongs, expected or not.
fn pongs(seen: &HostStatistics) -> u32 {
    seen.round_trip.count().saturating_add(seen.pongs_unasked)
}

/// A motor command; a positive `turn` is to the right. Named by its direction, so that the sign is
/// the one that robots use (ruling U6).
pub(crate) fn motor_control(speed: i16, turn: i16) -> Result<MotorControl, EncodeError> {
    match turn {
        0.. => MotorControl::turn_right(speed, turn),
        _ => MotorControl::turn_left(speed, -turn),
    }
}

/// A motor command as text, with the direction of the nose where the steering alone would mislead
/// (ruling U6).
pub(crate) fn describe(command: &MotorControl) -> String {
    let (speed, turn) = (command.speed(), command.angular());
    let (side, other) = if turn < 0 { (" left", "right") } else { (" right", "left") };
    let side = if turn == 0 { "" } else { side };
    let is_reverse = MotorControl::yaw_right(speed, turn.abs()).is_ok_and(|it| it.angular() < 0);
    let nose = if is_reverse && turn != 0 {
        format!(" (in reverse: the nose swings {other})")
    } else {
        String::new()
    };
    format!("speed {speed} %, turn {} %{side}{nose}", turn.abs())
}

#[cfg(all(test, unix))]
mod tests;
