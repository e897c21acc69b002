//! A host, its application, its port, and a robot that sends anything at any time.

use super::{
    host_account::Account,
    host_checks::is_frequent,
    host_store::Shelf,
    names::*,
    search::World,
    ucp::{Checked, Fate, Feed, check_kept, merge, ms, queue},
};

/// A message from the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hear {
    Report,
    Pong,
    StartAck(CalibrationKind, ErrorCode),
    EndAck(CalibrationKind),
    Imu(i16),
    Mag(i16),
    BiasRequest,
    UpdateAnswer(OtaStatus),
    Unknown,
    /// An acknowledgement of a start, with one bit flipped.
    Damaged,
    /// A motor command: our own, on a line that echoes.
    Echo,
    /// The first part of an IMU result, and the rest of it.
    Front,
    Rest,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Act {
    /// 1: ahead, with the lamp on. 2: on the spot. 3: a zero command.
    Go(u8),
    Stop,
    Calibrate(CalibrationStep, CalibrationKind),
    Show(u32),
    Update,
    EndUpdate,
    Hear(Hear),
    /// The store works, or fails.
    SetStore(bool),
    TakeEvent,
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
pub(super) const VERSION: i16 = 41;

#[derive(Clone, Debug)]
pub(crate) struct Site {
    pub(super) host: Host<Shelf>,
    pub(super) now: Instant,
    pub(super) menu: &'static [Act],
    pub(super) account: Account,
    pub(super) feed: Feed<Hear>,
    /// The driver takes the events.
    pub(super) takes_events: bool,
    /// Events taken in this step.
    pub(super) popped: Vec<HostEvent>,
    /// The application was found silent in this step.
    is_halted: bool,
}

pub(super) fn command(number: u8) -> MotorControl {
    match number {
        1 => MotorControl::new(60, 0).unwrap().with_front_led(true),
        2 => MotorControl::new(0, 50).unwrap(),
        _ => MotorControl::STOP,
    }
}

impl Site {
    pub(crate) fn new(config: HostConfig, is_open: bool, menu: &'static [Act]) -> Self {
        let now = Instant::from_micros(1_000_000);
        let shelf = Shelf { is_open, ..Shelf::default() };
        Self {
            host: Host::with_store(config, shelf, now),
            now,
            menu,
            account: Account::new(&config, now),
            feed: Feed::new(),
            takes_events: true,
            popped: Vec::new(),
            is_halted: false,
        }
    }

    /// The state after these actions, none of which breaks an invariant.
    pub(crate) fn after(mut self, actions: &[Act]) -> Self {
        for &action in actions {
            self.step(action).unwrap_or_else(|broken| panic!("{action:?}: {broken}"));
        }
        self
    }

    /// Takes an event; checks that what it reports has happened.
    fn take_event(&mut self) -> Result<bool, String> {
        let Some(event) = self.host.poll_event() else { return Ok(false) };
        self.told(&event)?;
        self.popped.push(event);
        Ok(true)
    }

    fn take_events(&mut self) -> Checked {
        while self.take_event()? {}
        match self.account.untold.first() {
            Some(end) => Err(format!("the end of a request is not reported: {end:?}")),
            None => Ok(()),
        }
    }

    /// The driver looks at the clock.
    fn settle(&mut self) -> Checked {
        let before = if self.feed.is_holding() { queue(&self.host) } else { Vec::new() };
        self.host.handle_timeout(self.now);
        self.is_halted |= self.account.motion.expire(self.now);
        self.account.expire(self.now);
        let counters = self.host.counters();
        for (hear, at) in self.feed.arrived(&counters, self.now)? {
            self.heard(hear, at, &before)?;
        }
        self.check_calibration()
    }

    /// Hands out a frame; returns whether there was one.
    fn one(&mut self) -> Result<bool, String> {
        let (shelf, now) = (self.host.store().clone(), self.now);
        self.is_halted |= self.account.motion.expire(now);
        let Some(frame) = self.host.poll_transmit(now) else { return Ok(false) };
        self.account.frame(frame, &shelf, now)?;
        Ok(true)
    }

    fn fail(&mut self, unsent: Unsent) {
        self.host.handle_unsent(unsent, self.now);
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
        self.account.flushed();
        self.check_rest()
    }

    /// The driver runs, and wakes at the role's deadlines.
    fn run(&mut self, millis: u32) -> Checked {
        let end = self.now + ms(millis);
        while let Some(at) = self.host.poll_timeout().filter(|&at| at <= end) {
            self.now = self.now.max(at);
            self.round(Fate::Flushed)?;
        }
        self.now = end;
        Ok(())
    }

    fn act(&mut self, act: Act) -> Checked {
        match act {
            Act::Go(_) | Act::Calibrate(..) | Act::Show(_) | Act::Update => self.call(act)?,
            Act::Stop => {
                self.host.stop(self.now);
                self.end_update();
                self.account.motion.stop(self.now);
            }
            Act::EndUpdate => {
                self.host.end_firmware_update(self.now);
                self.end_update();
            }
            Act::Hear(hear) => self.hear(hear)?,
            Act::SetStore(fails) => self.host.store_mut().fails = fails,
            Act::TakeEvent => {
                self.take_event()?;
            }
            Act::Round(fate) => self.round(fate)?,
            Act::One => {
                if !self.one()? {
                    self.account.flushed();
                }
            }
            Act::Fail(unsent) => self.fail(unsent),
            Act::Wait(micros) => self.now += Duration::from_micros(micros),
            Act::ToDeadline(past) => {
                let at = self.host.poll_timeout().unwrap_or(self.now);
                self.now = self.now.max(at) + Duration::from_micros(past);
            }
            Act::Run(millis) => self.run(millis)?,
        }
        Ok(())
    }
}

impl World for Site {
    type Action = Act;

    fn actions(&self) -> Vec<Act> {
        let is_possible = |act: &&Act| !matches!(act, Act::Fail(_)) || self.account.is_unflushed;
        self.menu.iter().filter(is_possible).copied().collect()
    }

    fn step(&mut self, act: Act) -> Checked {
        let before = queue(&self.host);
        (self.popped, self.is_halted) = (Vec::new(), false);
        self.act(act)?;
        let after = queue(&self.host);
        let is_told = self.popped.iter().chain(&after).any(|it| *it == HostEvent::DeadMan);
        if self.is_halted && !is_told && after.len() < ROOM {
            return Err("the dead-man has fired without an event".into());
        }
        check_kept(&before, &self.popped, &after, |event| !is_frequent(event))?;
        self.check(&after)
    }

    fn fingerprint(&self) -> u64 {
        let all = (&self.host, &self.account, &self.feed);
        merge(self.now, &self.host.counters()).fingerprint(&all)
    }
}
