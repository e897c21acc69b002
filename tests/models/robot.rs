//! A robot, its application, its port, and a host that sends anything at any time.

use axlewire::ucp::Robot;

use super::{
    names::*,
    robot_account::Account,
    robot_checks::{imu, is_frequent, mag},
    search::World,
    ucp::{Checked, Fate, Feed, check_kept, halted, merge, ms, queue},
};

/// A message from the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hear {
    /// 1: ahead, with the lamp on. 2: on the spot. 3: a zero command. 4: out of range.
    Motor(u8),
    /// A motor command that would start an update.
    MotorUpdate,
    DamagedMotor,
    Ping,
    Start(CalibrationKind),
    End(CalibrationKind),
    ImuAck(ErrorCode),
    MagAck,
    Biases,
    Update,
    Show(u32),
    Unknown,
    /// A pong: our own, on a line that echoes.
    Echo,
    /// The first part of motor command 1, and the rest of it.
    Front,
    Rest,
    /// The first part of a frame longer than two motor commands.
    LongFront,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Act {
    Hear(Hear),
    /// It arrived up to 400 ms ago: the driver was held up.
    HearOld(Hear),
    /// The application polls for a new command.
    TakeCommand,
    Telemetry(u16),
    /// A calibration has its result.
    Imu(i16),
    Mag(i16),
    Abort,
    AnswerUpdate(OtaStatus),
    TakeEvent,
    /// Takes all events, and handles the time.
    TakeEvents,
    /// The driver does everything that is due.
    Round(Fate),
    /// One frame is handed out, without a prior `handle_timeout`.
    One,
    /// The last frame handed out comes back, or the flush after it fails.
    Fail(Unsent),
    Wait(u32),
    /// Until the deadline, plus this many microseconds.
    ToDeadline(u32),
    /// The driver runs for this long, milliseconds.
    Run(u32),
}

/// Capacity of the event queue.
pub(super) const ROOM: usize = 16;

/// Firmware version on offer.
pub(super) const UPDATE_TO: i16 = 39;

#[derive(Clone, Debug)]
pub(crate) struct Rover {
    pub(super) robot: Robot,
    pub(super) now: Instant,
    menu: &'static [Act],
    pub(super) account: Account,
    pub(super) feed: Feed<Hear>,
    /// The driver takes the events.
    takes_events: bool,
    /// Events taken in this step.
    popped: Vec<RobotEvent>,
}

impl Rover {
    pub(crate) fn new(config: RobotConfig, menu: &'static [Act]) -> Self {
        let now = Instant::from_micros(1_000_000);
        Self {
            robot: Robot::new(config, now),
            now,
            menu,
            account: Account::new(&config, now),
            feed: Feed::new(),
            takes_events: true,
            popped: Vec::new(),
        }
    }

    pub(crate) fn undrained(mut self) -> Self {
        self.takes_events = false;
        self
    }

    /// The state after these actions, none of which breaks an invariant.
    pub(crate) fn after(mut self, actions: &[Act]) -> Self {
        for &action in actions {
            self.step(action).unwrap_or_else(|broken| panic!("{action:?}: {broken}"));
        }
        self
    }

    /// The robot stopped for lack of a command, and has registered that.
    fn watch(&mut self, now: Instant) {
        if self.account.until.is_some_and(|until| until <= now) {
            (self.account.command, self.account.until) = (halted(self.account.command), None);
        }
    }

    fn take_event(&mut self) -> bool {
        let Some(event) = self.robot.poll_event() else { return false };
        self.told(&event);
        self.popped.push(event);
        true
    }

    fn take_events(&mut self) -> Checked {
        while self.take_event() {}
        self.check_told()
    }

    /// The driver looks at the clock.
    fn settle(&mut self) -> Checked {
        let before = if self.feed.is_holding() { queue(&self.robot) } else { Vec::new() };
        self.robot.handle_timeout(self.now);
        let counters = self.robot.counters();
        for (hear, at) in self.feed.arrived(&counters, self.now)? {
            self.heard(hear, at, &before)?;
        }
        self.watch(self.now);
        Ok(())
    }

    /// Hands out a frame; returns whether there was one.
    fn one(&mut self) -> Result<bool, String> {
        let Some(frame) = self.robot.poll_transmit(self.now) else { return Ok(false) };
        self.account.frame(frame, self.now)?;
        Ok(true)
    }

    fn fail(&mut self, unsent: Unsent) {
        self.robot.handle_unsent(unsent, self.now);
        self.account.unsent(unsent, self.now);
    }

    fn round(&mut self, fate: Fate) -> Checked {
        self.settle()?;
        if self.takes_events {
            self.take_events()?;
        }
        let mut frames = 0;
        while self.one()? {
            frames += 1;
            if let Fate::First(unsent) = fate {
                self.fail(unsent);
                return Ok(());
            }
            if frames > 16 {
                return Err("it never stops sending".into());
            }
        }
        if fate == Fate::NotFlushed && self.account.is_unflushed {
            self.fail(Unsent::Unflushed);
            return Ok(());
        }
        self.account.is_unflushed = false;
        self.check_rest()
    }

    /// The driver runs, and wakes at the role's deadlines.
    fn run(&mut self, millis: u32) -> Checked {
        let end = self.now + ms(millis);
        while let Some(at) = self.robot.poll_timeout().filter(|&at| at <= end) {
            self.now = self.now.max(at);
            self.round(Fate::Flushed)?;
        }
        self.now = end;
        Ok(())
    }

    fn act(&mut self, act: Act) -> Checked {
        let now = self.now;
        match act {
            Act::Hear(hear) => self.hear(hear, now)?,
            Act::HearOld(hear) => {
                let since = Instant::from_micros(now.as_micros() - 400_000);
                self.hear(hear, since)?;
            }
            Act::TakeCommand => {
                let taken = self.robot.take_command(now);
                self.watch(now);
                self.account.taken = taken.unwrap_or(self.account.taken);
                if self.account.taken != self.account.expected(now) {
                    return Err(format!("take_command: {taken:?}: {:?}", self.account));
                }
            }
            Act::Telemetry(battery_pct) => {
                let telemetry = Telemetry { battery_pct, ..Telemetry::default() };
                self.robot.set_telemetry(&telemetry, now);
                self.account.telemetry = telemetry;
                self.account.report_at.get_or_insert(now);
            }
            Act::Imu(value) => {
                self.robot.calibration_result_imu(imu(value), now);
                self.account.imu.begin(value, now);
                self.has_result(CalibrationKind::Imu);
            }
            Act::Mag(value) => {
                self.robot.calibration_result_mag(mag(value), now);
                self.account.mag.begin(value, now);
                self.has_result(CalibrationKind::Magnetometer);
            }
            Act::Abort => {
                let was = self.account.calibrating.take().map(|(kind, _)| kind);
                if self.robot.abort_calibration() != was {
                    return Err(format!("aborted: {was:?}"));
                }
            }
            Act::AnswerUpdate(status) => {
                let was_asked = std::mem::take(&mut self.account.is_update_asked);
                if self.robot.answer_update(status, now) != was_asked {
                    return Err(format!("an update was asked for: {was_asked}"));
                }
                if was_asked {
                    self.account.update_answer = Some((status, true));
                }
            }
            Act::TakeEvent => {
                self.take_event();
            }
            Act::TakeEvents => {
                self.settle()?;
                self.take_events()?;
            }
            Act::Round(fate) => self.round(fate)?,
            Act::One => {
                if !self.one()? {
                    self.account.is_unflushed = false;
                }
            }
            Act::Fail(unsent) => self.fail(unsent),
            Act::Wait(micros) => self.now += Duration::from_micros(micros),
            Act::ToDeadline(past) => {
                let at = self.robot.poll_timeout().unwrap_or(now);
                self.now = now.max(at) + Duration::from_micros(past);
            }
            Act::Run(millis) => self.run(millis)?,
        }
        Ok(())
    }

    fn has_result(&mut self, of: CalibrationKind) {
        if let Some((kind, has_result)) = &mut self.account.calibrating {
            *has_result |= *kind == of;
        }
    }
}

impl World for Rover {
    type Action = Act;

    fn actions(&self) -> Vec<Act> {
        let is_possible = |act: &&Act| !matches!(act, Act::Fail(_)) || self.account.is_unflushed;
        self.menu.iter().filter(is_possible).copied().collect()
    }

    fn step(&mut self, act: Act) -> Checked {
        let before = queue(&self.robot);
        self.popped.clear();
        self.act(act)?;
        let after = queue(&self.robot);
        check_kept(&before, &self.popped, &after, |event| !is_frequent(event))?;
        self.check(&after)
    }

    fn fingerprint(&self) -> u64 {
        let all = (&self.robot, &self.account, &self.feed);
        merge(self.now, &self.robot.counters()).fingerprint(&all)
    }
}
