//! A master behind a driver, blocking or async, with or without a driver-enable pin.

use std::{
    cell::RefCell,
    hash::{DefaultHasher, Hash, Hasher},
    rc::Rc,
};

use super::{
    account::Account,
    action::{Action, Call, Pass, Setup},
    node::{Ear, SPEECH, SharedNode},
    task::run,
    *,
};
use crate::fingerprint::{COUNTERS_AND_STATUS, Merge};

pub(super) const N1: NodeId = NodeId::N1;

/// Duration of a [`Call::Idle`]: longer than an exchange, its guard and one more.
pub(super) const IDLE: Duration = Duration::from_millis(5);
pub(super) const SPAN: Duration = Duration::from_millis(4);
/// Shorter than the time that a fingerprint remembers.
pub(super) const COAST: Duration = Duration::from_millis(60);

pub(crate) struct MasterLife<P> {
    pub(super) setup: Setup,
    pub(super) line: Shared,
    pub(super) node: SharedNode,
    pub(super) driver: asynch::Driver<Master, P, Shared>,
    pub(super) account: Account,
}

/// The result of a call.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Told {
    Failure(Failure),
    Owed,
    Moving,
    /// Refused, timed out, not read.
    Other,
}

pub(super) type Outcome = Result<(), Told>;

pub(super) fn target(mode: Mode, number: u8) -> Target<OneMotor> {
    match mode {
        Mode::Velocity => Target::Velocity(Rps::new(number.into()).unwrap()),
        Mode::Position => Target::Position(Position::new(7, 1 + i16::from(number))),
    }
}

fn told<T, P: Wired>(result: Result<T, DriveError<P::Error>>) -> Outcome {
    result.map(drop).map_err(|error| match error {
        DriveError::StopsOwed(_) => Told::Owed,
        DriveError::StillMoving(_) => Told::Moving,
        error => failure::<P>(error).map_or(Told::Other, Told::Failure),
    })
}

impl<P: Wired> MasterLife<P> {
    fn blocking(&mut self, call: Call) -> Outcome {
        let target = target(self.setup.mode, 2);
        let driver: &mut Driver<_, _, _> = &mut self.driver;
        match (call, target) {
            (Call::Service, _) => told::<_, P>(driver.service()),
            (Call::Idle, _) => told::<_, P>(driver.run_for(IDLE, |_, _, _| ())),
            (Call::Discover, _) => told::<_, P>(driver.discover()),
            (Call::Set(number), _) => told::<_, P>(match self::target(self.setup.mode, number) {
                Target::Velocity(velocity) => driver.set_velocity(N1, velocity),
                Target::Position(position) => driver.set_position(N1, position),
            }),
            (Call::Stop, _) => told::<_, P>(driver.stop(N1)),
            (Call::StopAll, _) => told::<_, P>(driver.stop_all()),
            (Call::Read, _) => told::<_, P>(driver.read(N1)),
            (Call::DriveFor, Target::Velocity(velocity)) => {
                told::<_, P>(driver.drive_for(N1, velocity, SPAN))
            }
            (Call::DriveFor | Call::Discard | Call::KeepAlive, _) => Ok(()),
        }
    }

    async fn waiting(&mut self, call: Call) -> Outcome {
        let (driver, target) = (&mut self.driver, target(self.setup.mode, 2));
        match (call, target) {
            (Call::Service, _) => told::<_, P>(driver.service().await),
            (Call::Idle, _) => told::<_, P>(driver.run_for(IDLE, |_, _, _| ()).await),
            (Call::Discover, _) => told::<_, P>(driver.discover().await),
            (Call::Set(number), _) => told::<_, P>(match self::target(self.setup.mode, number) {
                Target::Velocity(velocity) => driver.set_velocity(N1, velocity).await,
                Target::Position(position) => driver.set_position(N1, position).await,
            }),
            (Call::Stop, _) => told::<_, P>(driver.stop(N1).await),
            (Call::StopAll, _) => told::<_, P>(driver.stop_all().await),
            (Call::Read, _) => told::<_, P>(driver.read(N1).await),
            (Call::DriveFor, Target::Velocity(velocity)) => {
                told::<_, P>(driver.drive_for(N1, velocity, SPAN).await)
            }
            (Call::DriveFor | Call::Discard | Call::KeepAlive, _) => Ok(()),
        }
    }

    fn call(&mut self, call: Call, drop_after: Option<usize>) -> Result<(), String> {
        if call == Call::Discard {
            self.line.line().wire.is_given_up |= !self.driver.unsent().is_empty();
            self.driver.discard();
            return Ok(());
        }
        let before = self.before(call);
        self.line.line().begin();
        if matches!(call, Call::Stop | Call::StopAll) {
            self.line.line().wire.stop();
        }
        if call == Call::KeepAlive {
            let now = self.driver.now();
            self.driver.role_mut().keep_alive(now);
        }
        let end = if self.setup.is_async {
            let line = self.line.clone();
            guarded(|| run(&line, drop_after, self.waiting(call)))?
        } else {
            guarded(|| Ok(End::Done(self.blocking(call), usize::MAX)))?
        };
        self.after(call, before, end)
    }

    fn pass(&mut self, pass: Pass) {
        let timeout = self.driver.poll_timeout();
        let mut line = self.line.line();
        let to_timeout = timeout.map_or(0, |at| (at - line.role_now()).as_micros());
        let span_us: u32 = match pass {
            Pass::Short => 50,
            Pass::Pause => 150,
            Pass::Deadline => to_timeout,
            Pass::PastDeadline => to_timeout + 1,
            Pass::Long => 10_000_000,
            Pass::Back => {
                line.back_us += 10_000_000;
                return;
            }
        };
        let until_us = line.now_us + u64::from(span_us);
        line.pass_until(until_us);
    }
}

impl<P: Wired> Life for MasterLife<P> {
    type Setup = Setup;
    type Action = Action;

    fn begin(setup: Setup) -> Self {
        let node = Node::new(setup.mode);
        let node = Rc::new(RefCell::new(node));
        let ear = Box::new(Ear(node.clone()));
        let line = DrivenLine::new(Wire::new(SPEECH), ear, P::HAS_PIN);
        let line = Shared(Rc::new(RefCell::new(line)));
        let mut config = MasterConfig::direct();
        config.nodes = N1.into();
        config.coast = COAST;
        config.polling = Polling::Every(Duration::from_millis(1));
        config.dead_man = setup.dead_man_ms.map(Duration::from_millis);
        let driver = asynch::Driver::master(config, P::plug(&line), line.clone());
        Self { setup, line, node, driver, account: Account::default() }
    }

    fn actions(setup: Setup, past: &[Action]) -> Vec<Action> {
        setup.actions(past)
    }

    fn step(&mut self, action: Action) -> Result<(), String> {
        match action {
            Action::Fault(fault) => {
                fault.arrange(&mut self.line.line(), Some(&mut *self.node.borrow_mut()));
                Ok(())
            }
            Action::Pass(pass) => {
                self.pass(pass);
                Ok(())
            }
            Action::Call(call) => self.call(call, None),
            Action::Drop(call, polls) => self.call(call, Some(polls)),
        }
    }

    fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        let merge = Merge { now: self.line.line().role_now(), skipped: SKIPPED };
        let node = self.node.borrow();
        let place = Position::new(node.count, 1);
        merge.fingerprint(&(&self.driver, place)).hash(&mut hasher);
        self.line.line().hash(&mut hasher);
        (&node.answers, node.is_gone, node.is_deaf, node.told).hash(&mut hasher);
        self.account.digest(&node, &self.line.line()).hash(&mut hasher);
        hasher.finish()
    }
}

const SKIPPED: &[&str] = &{
    let mut skipped = ["ahead_us"; COUNTERS_AND_STATUS.len() + 1];
    let mut at = 0;
    while at < COUNTERS_AND_STATUS.len() {
        skipped[at] = COUNTERS_AND_STATUS[at];
        at += 1;
    }
    skipped
};
