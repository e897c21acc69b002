//! A host of a rover behind a blocking driver, with or without a driver-enable pin.

use std::{
    cell::RefCell,
    hash::{DefaultHasher, Hash, Hasher},
    rc::Rc,
};

use super::{action::Fault, host_account::Account, node::crc, *};
use crate::fingerprint::{COUNTERS, Merge};

/// 115,200 bit/s.
const BYTE_US: u64 = 87;
/// A robot of this crate waits about 5 ms for the rest of a frame.
const SPEECH: Speech =
    Speech { shape, moves, byte_us: BYTE_US, pause_us: 5_000, needs_silence: false };

/// Longer than the period of motor commands in this world, 10 ms.
pub(super) const IDLE: Duration = Duration::from_millis(15);
pub(super) const SPAN: Duration = Duration::from_millis(30);
/// The dead-man of the host.
pub(super) const TIMEOUT_US: u64 = 50_000;

pub(crate) struct HostLife<P> {
    pub(super) line: Shared,
    pub(super) driver: Driver<Host, P, Shared>,
    pub(super) account: Account,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Action {
    Fault(Fault),
    /// Milliseconds without a call.
    Pass(u32),
    Back,
    Call(Call),
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Call {
    Service,
    Idle,
    /// Drives at this speed.
    Drive(i16),
    Stop,
    DriveFor,
    Ping,
    Discard,
}

/// The result of a call.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Told {
    Failure(Failure),
    Other,
}

pub(super) type Outcome = Result<(), Told>;

/// A robot that answers pings, and motor commands with a report of its wheels.
struct Rover;

impl Peer for Rover {
    fn hear(&mut self, frame: &[u8], _: u64) -> Option<(u64, Vec<u8>)> {
        let mut answer = vec![0xFD, 0xFF, 5, 0, 1, 0, 0];
        match frame[4] {
            1 => {}
            2 => {
                (answer[2], answer[4]) = (40, 5);
                answer.resize(42, 0);
                answer[8] = frame[6];
            }
            _ => return None,
        }
        answer.extend(crc(&answer).to_le_bytes());
        Some((500, answer))
    }
}

/// A frame as documented: FD FF, the length, an id, an index, the body, the CRC.
fn shape(bytes: &[u8]) -> Shape {
    let begins = bytes.iter().zip([0xFD, 0xFF]).all(|(&byte, header)| byte == header);
    let &[_, _, low, high, ..] = bytes else {
        return if begins { Shape::Part } else { Shape::Bad };
    };
    let len = usize::from(u16::from_le_bytes([low, high]));
    match bytes.len() {
        _ if !begins || !(4..=60).contains(&len) => Shape::Bad,
        have if have < len + 4 => Shape::Part,
        have if have == len + 4 && crc(bytes) == 0 => Shape::Whole,
        _ => Shape::Bad,
    }
}

/// A motor command that is not a stop.
fn moves(frame: &[u8]) -> bool {
    frame[4] == 2 && frame[6..10] != [0; 4]
}

impl<P: Wired> HostLife<P> {
    fn told<T>(result: Result<T, DriveError<P::Error>>) -> Outcome {
        result.map(drop).map_err(|error| failure::<P>(error).map_or(Told::Other, Told::Failure))
    }

    fn blocking(&mut self, call: Call) -> Outcome {
        let driver = &mut self.driver;
        match call {
            Call::Service => Self::told(driver.service()),
            Call::Idle => Self::told(driver.run_for(IDLE, |_, _, _| ())),
            Call::Drive(speed) => Self::told(driver.drive(speed, 0)),
            Call::Stop => Self::told(driver.stop()),
            Call::DriveFor => Self::told(driver.drive_for(60, 0, SPAN)),
            Call::Ping => Self::told(driver.ping(Duration::from_millis(60))),
            Call::Discard => {
                driver.discard();
                Ok(())
            }
        }
    }
}

impl<P: Wired> Life for HostLife<P> {
    /// Most faults pending at a time.
    type Setup = usize;
    type Action = Action;

    fn begin(_: usize) -> Self {
        let line = DrivenLine::new(Wire::new(SPEECH), Box::new(Rover), P::HAS_PIN);
        let line = Shared(Rc::new(RefCell::new(line)));
        let mut config = HostConfig::default();
        config.command_period = Duration::from_millis(10);
        config.command_gap = Duration::from_millis(2);
        config.dead_man = Duration::from_micros(TIMEOUT_US as u32);
        config.ping_period = Some(Duration::from_millis(40));
        config.ping_timeout = Duration::from_millis(50);
        config.link_timeout = Duration::from_millis(80);
        config.rpm_average = Duration::ZERO;
        let driver = Driver::host(config, P::plug(&line), line.clone());
        Self { line, driver, account: Account::default() }
    }

    fn actions(faults: usize, past: &[Action]) -> Vec<Action> {
        let is_fault = |action: &&Action| matches!(action, Action::Fault(_));
        let waiting = past.iter().rev().take_while(is_fault).count();
        let mut actions = vec![];
        if waiting < faults {
            actions.extend(Fault::of_port(P::HAS_PIN, false).into_iter().map(Action::Fault));
        }
        if waiting == 0 {
            actions.extend([1, 10, 25, 60, 10_000].map(Action::Pass));
            actions.extend([Action::Back, Action::Call(Call::Discard)]);
        }
        let calls = [Call::Service, Call::Idle, Call::Drive(20), Call::Drive(40), Call::Stop];
        actions.extend(calls.map(Action::Call));
        actions.extend([Call::DriveFor, Call::Ping].map(Action::Call));
        actions
    }

    fn step(&mut self, action: Action) -> Result<(), String> {
        match action {
            Action::Fault(fault) => fault.arrange(&mut self.line.line(), None),
            Action::Pass(millis) => {
                let until_us = self.line.line().now_us + u64::from(millis) * 1000;
                self.line.line().pass_until(until_us);
            }
            Action::Back => self.line.line().back_us += 10_000_000,
            Action::Call(call) => {
                let before = self.before();
                self.line.line().begin();
                if call == Call::Discard {
                    self.line.line().wire.is_given_up |= !self.driver.unsent().is_empty();
                }
                if call == Call::Stop {
                    self.line.line().wire.stop();
                }
                let outcome = guarded(|| Ok(self.blocking(call)))?;
                self.after(call, before, outcome)?;
            }
        }
        Ok(())
    }

    fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        let merge = Merge { now: self.line.line().role_now(), skipped: SKIPPED };
        merge.fingerprint(&self.driver).hash(&mut hasher);
        self.line.line().hash(&mut hasher);
        self.account.digest(&self.line.line()).hash(&mut hasher);
        hasher.finish()
    }
}

const SKIPPED: &[&str] = &{
    let more = ["ahead_us", "counters", "index", "outgoing", "stats"];
    let mut skipped = [""; COUNTERS.len() + 5];
    let mut at = 0;
    while at < skipped.len() {
        skipped[at] = if at < 5 { more[at] } else { COUNTERS[at - 5] };
        at += 1;
    }
    skipped
};
