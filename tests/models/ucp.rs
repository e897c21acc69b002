//! What the worlds of a host and of a robot share: received frames, time, and the state of a port.

use axlewire::{crc16, ucp::Body};

use super::names::*;

/// The result of a step: `Err` names the invariant.
pub(crate) type Checked = Result<(), String>;

/// The fate of the frames that a role sends now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fate {
    /// All of it leaves and is flushed.
    Flushed,
    /// The first frame comes back.
    First(Unsent),
    /// The port takes all of it, and the flush fails.
    NotFlushed,
}

/// Counters, settings that never change, and data already handed out.
const SKIPPED: [&str; 11] = [
    "config",
    "stats",
    "lost",
    "outgoing",
    "index",
    "round_trip",
    "new_round_trip",
    "last_report",
    "newest_len",
    "framed",
    "inbox",
];

/// An empty inbox is left out: it then only knows when bytes last arrived.
pub(crate) fn merge(now: Instant, counters: &Counters) -> Merge {
    let len = SKIPPED.len() - usize::from(pending(counters) > 0);
    Merge { now, skipped: &SKIPPED[..len] }
}

pub(crate) fn pending(counters: &Counters) -> u64 {
    counters.received - counters.framed - counters.skipped()
}

pub(crate) const fn ms(millis: u32) -> Duration {
    Duration::from_millis(millis)
}

pub(crate) fn bytes<B: Body>(body: B) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

pub(crate) fn imu(value: i16) -> ImuBias {
    ImuBias::new([value; 3], [-value; 3])
}

pub(crate) fn mag(value: i16) -> MagBias {
    MagBias::new([value; 3])
}

/// Speed and turn 0, the lamp unchanged.
pub(crate) fn halted(command: MotorControl) -> MotorControl {
    MotorControl::STOP.with_front_led(command.front_led() == 100)
}

/// The same frame with one bit of its body flipped.
pub(crate) fn damaged(mut frame: Vec<u8>) -> Vec<u8> {
    frame[6] ^= 0x10;
    frame
}

/// A good frame with an id that no message has.
pub(crate) fn unknown() -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, 5, 0, 0x42, 0, 7];
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}

/// The events that wait in a role, in order.
pub(crate) fn queue<R: Endpoint + Clone>(role: &R) -> Vec<R::Event> {
    let mut copy = role.clone();
    std::iter::from_fn(|| copy.poll_event()).collect()
}

/// Frames on their way through a decoder, which holds them back after half a frame.
#[derive(Clone, Debug)]
pub(crate) struct Feed<H> {
    /// With their lengths; `true` for one that came in two halves and may be dropped.
    held: Vec<(H, u64, bool)>,
    framed: u64,
    /// The oldest byte held back arrived at this time or later.
    since: Instant,
    /// A later chunk that may hold it as well: its time, and the number of bytes from there on.
    between: (Instant, u64),
    /// The newest of them is arriving.
    has_new: bool,
    /// The last thing received is the first part of a frame.
    pub(crate) is_half: bool,
}

impl<H: Copy + std::fmt::Debug> Feed<H> {
    pub(crate) const fn new() -> Self {
        let since = Instant::from_micros(0);
        let between = (since, 0);
        Self { held: Vec::new(), framed: 0, since, between, has_new: false, is_half: false }
    }

    pub(crate) fn is_holding(&self) -> bool {
        !self.held.is_empty()
    }

    /// This many bytes have arrived and been searched.
    pub(crate) fn took(&mut self, len: usize, counters: &Counters, now: Instant) {
        let (pending, len) = (pending(counters), len as u64);
        self.between.1 += len;
        if pending <= len {
            (self.since, self.between) = (now, (now, len));
        } else if pending <= self.between.1 {
            (self.since, self.between) = (self.between.0, (now, len));
        }
    }

    pub(crate) fn push(&mut self, hear: H, len: usize, is_in_halves: bool) {
        self.held.push((hear, len as u64, is_in_halves));
        self.has_new = true;
    }

    /// What the role must have received by now (ruling B2), with its effective age: a whole frame
    /// that was held back is as old as the first byte held back can be.
    pub(crate) fn arrived(
        &mut self,
        counters: &Counters,
        now: Instant,
    ) -> Result<Vec<(H, Instant)>, String> {
        let mut news = counters.framed - std::mem::replace(&mut self.framed, counters.framed);
        let mut arrived = Vec::new();
        while news > 0 {
            // One that came in halves was dropped if the next one has arrived.
            let index = self.held.iter().position(|(_, len, _)| *len <= news);
            let index = index.ok_or("a frame that was never sent")?;
            if self.held.drain(..index).any(|(_, _, is_in_halves)| !is_in_halves) {
                return Err("a whole frame was lost".into());
            }
            let (hear, len, _) = self.held.remove(0);
            let is_new = self.held.is_empty() && self.has_new;
            arrived.push((hear, if is_new { now } else { self.since }));
            news -= len;
        }
        self.has_new = false;
        if pending(counters) == 0 && self.held.drain(..).any(|(_, _, in_halves)| !in_halves) {
            return Err("a whole frame was lost".into());
        }
        Ok(arrived)
    }
}

/// Events are never taken back: a waiting one is still there, or was handed out.
pub(crate) fn check_kept<E: PartialEq + std::fmt::Debug>(
    before: &[E],
    popped: &[E],
    after: &[E],
    is_rare: impl Fn(&E) -> bool,
) -> Checked {
    let mut found = popped.iter().chain(after).filter(|event| is_rare(event));
    match before.iter().filter(|event| is_rare(event)).find(|event| found.next() != Some(event)) {
        Some(event) => Err(format!("{event:?} is lost")),
        None => Ok(()),
    }
}
