//! The other side of a driver: time, a line, and its faults.

use std::{
    cell::RefCell,
    collections::VecDeque,
    fmt::{self, Debug},
    hash::{Hash, Hasher},
    rc::Rc,
    task::Waker,
};

use super::*;
use crate::names::*;

/// Most operations of the port, the pin and the clock in one call: far more than any call of these
/// worlds needs.
const OPERATIONS: u32 = 200_000;

/// The receiver of what is sent.
pub(crate) trait Peer {
    /// Receives a frame; returns the delay of the answer after its end, microseconds, and the
    /// answer.
    fn hear(&mut self, frame: &[u8], end_us: u64) -> Option<(u64, Vec<u8>)>;

    /// When its last answer arrives that puts its mode in doubt.
    fn doubts_us(&self) -> u64 {
        0
    }
}

pub(crate) struct DrivenLine {
    pub(crate) now_us: u64,
    /// Amount by which the driver's clock has gone back.
    pub(crate) back_us: u64,
    /// The time that a role has to be given: that of the clock, which stops instead of going back.
    ahead_us: u64,
    pub(crate) latest_us: u64,
    pub(crate) wire: Wire,
    pub(crate) peer: Box<dyn Peer>,
    /// Bytes on their way to the driver, with their arrival times.
    pub(crate) inbox: VecDeque<(u64, u8)>,
    /// When the last byte written will have left.
    pub(crate) free_us: u64,
    /// Bytes taken that wait for a flush, and when their write began.
    pub(crate) held: Vec<u8>,
    pub(crate) held_since_us: u64,
    pub(crate) reads: VecDeque<Reading>,
    pub(crate) writes: VecDeque<Writing>,
    pub(crate) flushes: VecDeque<Flushing>,
    pub(crate) pins: VecDeque<Pinning>,
    /// When the current call began.
    pub(crate) begun_us: u64,
    pub(crate) writes_in_call: u32,
    /// When the current call first tried to write.
    pub(crate) first_write_us: Option<u64>,
    /// The current call has used the port; a refused call does not.
    pub(crate) is_touched: bool,
    /// A write was tried since the last flush attempt.
    pub(crate) is_flush_due: bool,
    /// Whether the driver has a pin; when it went on, if it is on.
    pub(crate) has_pin: bool,
    pub(crate) pin_on_us: Option<u64>,
    /// An async write or flush, or a delay of the pin, is in progress.
    pub(crate) is_sending: bool,
    /// Start of a requested operation that no call has waited for, microseconds.
    pub(crate) waits_since_us: Option<u64>,
    /// Such an operation may have stalled in the current call.
    pub(crate) may_have_stalled: bool,
    /// In the current call.
    pub(crate) failures: Vec<(u64, Failure)>,
    /// The first of them was a write failure.
    pub(crate) has_write_failed_first: bool,
    /// A write was given up behind a failure, which its call may not tell.
    pub(crate) may_be_untold: bool,
    /// A flush has failed, or the port has stalled: the bytes it has taken may be lost.
    pub(crate) is_given_up: bool,
    pub(crate) sleepers: Vec<(u64, u32, Waker)>,
    sleepers_so_far: u32,
    operations: u32,
    /// The first invariant that was broken inside a call.
    pub(crate) broken: Option<String>,
}

/// A handle of a line: its port, pin, clock and delay are all handles.
#[derive(Clone)]
pub(crate) struct Shared(pub(crate) Rc<RefCell<DrivenLine>>);

/// Not part of a driver's state.
impl Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Shared")
    }
}

impl DrivenLine {
    pub(crate) fn new(wire: Wire, peer: Box<dyn Peer>, has_pin: bool) -> Self {
        // Not 0, so that a clock can go back.
        let start_us = 100_000_000_000;
        Self {
            now_us: start_us,
            back_us: 0,
            ahead_us: 0,
            latest_us: start_us,
            wire,
            peer,
            inbox: VecDeque::new(),
            free_us: start_us,
            reads: VecDeque::new(),
            writes: VecDeque::new(),
            flushes: VecDeque::new(),
            pins: VecDeque::new(),
            begun_us: start_us,
            writes_in_call: 0,
            first_write_us: None,
            is_touched: false,
            held: vec![],
            held_since_us: 0,
            is_flush_due: false,
            has_pin,
            pin_on_us: None,
            is_sending: false,
            waits_since_us: None,
            may_have_stalled: false,
            failures: vec![],
            has_write_failed_first: false,
            is_given_up: false,
            may_be_untold: false,
            sleepers: vec![],
            sleepers_so_far: 0,
            operations: 0,
            broken: None,
        }
    }

    /// A call begins.
    pub(crate) fn begin(&mut self) {
        self.begun_us = self.now_us;
        (self.writes_in_call, self.first_write_us, self.is_touched) = (0, None, false);
        self.operations = 0;
        self.failures.clear();
        self.has_write_failed_first = false;
        (self.is_given_up, self.may_have_stalled, self.may_be_untold) = (false, false, false);
        self.wire.begin();
    }

    /// Records a broken invariant.
    pub(crate) fn object(&mut self, invariant: &str) {
        self.broken.get_or_insert_with(|| invariant.into());
    }

    /// One more operation. A call that does not end would continue forever, so a panic ends it.
    pub(crate) fn count(&mut self) {
        self.operations += 1;
        assert!(self.operations < OPERATIONS, "the call does not end");
    }

    pub(crate) fn fail(&mut self, make: fn(u8) -> Failure) -> u8 {
        let number = self.failures.len() as u8;
        self.failures.push((self.now_us, make(number)));
        number
    }

    pub(crate) fn failed(&mut self, failure: Failure) {
        self.failures.push((self.now_us, failure));
    }

    /// The driver's clock, which may have gone back.
    pub(crate) fn clock(&mut self) -> Instant {
        self.count();
        self.latest_us = self.role_us();
        self.ahead_us = self.latest_us - (self.now_us - self.back_us);
        Instant::from_micros(self.now_us - self.back_us)
    }

    /// The time that a role should be given if asked for now.
    fn role_us(&self) -> u64 {
        self.latest_us.max(self.now_us - self.back_us + self.ahead_us)
    }

    pub(crate) fn role_now(&self) -> Instant {
        Instant::from_micros(self.role_us())
    }

    /// While the driver idles or waits, the others run.
    pub(crate) fn pass_until(&mut self, until_us: u64) {
        self.now_us = self.now_us.max(until_us);
        let now_us = self.now_us;
        self.sleepers.retain(|(at_us, _, waker)| {
            if *at_us <= now_us {
                waker.wake_by_ref();
            }
            *at_us > now_us
        });
    }

    pub(crate) fn idle_until(&mut self, until: Instant) {
        self.count();
        if self.pin_on_us.is_some() && !self.has_pin_failed() {
            self.object("the driver-enable pin is on while the driver waits");
        }
        let arrival_us = self.inbox.front().map_or(u64::MAX, |&(at_us, _)| at_us);
        // As long as the clock reads less than `until`.
        let wait_us = until.as_micros().saturating_sub(self.now_us - self.back_us);
        let until_us = self.now_us + wait_us;
        self.pass_until(until_us.min(arrival_us).max(self.now_us + 1));
    }

    pub(crate) fn has_pin_failed(&self) -> bool {
        self.failures.iter().any(|(_, failure)| matches!(failure, Failure::Pin(_)))
    }

    /// Puts bytes on the wire. The write began at `begun_us`.
    pub(crate) fn carry(&mut self, bytes: &[u8], begun_us: u64) {
        let byte_us = self.wire.speech.byte_us;
        self.free_us = self.free_us.max(self.now_us) + byte_us * bytes.len() as u64;
        if let Err(invariant) = self.wire.carry(bytes, begun_us, self.now_us, self.free_us) {
            self.object(&invariant);
        }
        let is_lost = self.flushes.front() == Some(&Flushing::ErrorLost);
        while let Some(frame) = self.wire.next_unheard() {
            let answer = (!is_lost).then(|| self.peer.hear(&frame, self.free_us)).flatten();
            if let Some((after_us, answer)) = answer {
                let begin_us = self.free_us + after_us;
                let bytes = (1..).zip(answer).map(|(i, byte)| (begin_us + i * byte_us, byte));
                self.inbox.extend(bytes);
                self.inbox.make_contiguous().sort_by_key(|&(at_us, _)| at_us);
            }
        }
    }

    /// Sends what was held.
    pub(crate) fn release(&mut self) {
        let held = std::mem::take(&mut self.held);
        if !held.is_empty() {
            self.wire.is_in_parts = true;
            self.carry(&held, self.held_since_us);
        }
    }

    pub(crate) fn has_arrived(&self) -> bool {
        self.inbox.front().is_some_and(|&(at_us, _)| at_us <= self.now_us)
    }

    /// What the next read does, if not simply returning the available bytes.
    pub(crate) fn reading(&self) -> Option<Reading> {
        self.reads.front().copied().filter(|reading| match reading {
            Reading::One => self.has_arrived(),
            Reading::ErrorAfterWrite => self.writes_in_call > 0,
            Reading::ErrorLater => self.now_us >= self.begun_us + 300,
            _ => true,
        })
    }

    /// When there may be something to read, microseconds.
    pub(crate) fn readable_us(&self) -> u64 {
        let arrival_us = self.inbox.front().map_or(u64::MAX, |&(at_us, _)| at_us);
        let is_later = self.reads.front() == Some(&Reading::ErrorLater);
        arrival_us.min(if is_later { self.begun_us + 300 } else { u64::MAX })
    }

    pub(crate) fn next_sleeper(&mut self) -> u32 {
        self.sleepers_so_far += 1;
        self.sleepers_so_far
    }
}

/// The state that affects the future.
impl Hash for DrivenLine {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        (&self.reads, &self.writes, &self.flushes, &self.pins, &self.held).hash(hasher);
        self.wire.digest(self.now_us).hash(hasher);
        (self.pin_on_us.is_some(), self.free_us.saturating_sub(self.now_us)).hash(hasher);
        // Time that will pass unseen because the clock has gone back.
        let reading_us = self.now_us - self.back_us + self.ahead_us;
        self.latest_us.saturating_sub(reading_us).hash(hasher);
        let waits_us = self.waits_since_us.map(|at_us| (self.now_us - at_us).min(1_000_000));
        waits_us.hash(hasher);
        for &(at_us, byte) in &self.inbox {
            (at_us.saturating_sub(self.now_us), byte).hash(hasher);
        }
    }
}
