//! A talker: an endpoint that sends what a test tells it to, and records what it receives and when.

use std::collections::VecDeque;

#[cfg(feature = "ikeya")]
pub(crate) use axlewire::sim::Motor;
pub(crate) use axlewire::{
    endpoint::{Arrival, Endpoint},
    sim::{Direction, Faults, Input, Line, Rng, Stuck, Who},
    time::{Duration, Instant},
};

pub(crate) const fn us(micros: u32) -> Duration {
    Duration::from_micros(micros)
}

pub(crate) const fn at(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

/// Sends what it is told to send, and records what it receives and when.
#[derive(Debug, Default)]
pub(crate) struct Talker {
    to_say: VecDeque<(Instant, Vec<u8>)>,
    saying: Vec<u8>,
    pub(crate) heard: Vec<(u64, Vec<u8>)>,
}

impl Talker {
    pub(crate) fn say(&mut self, at: Instant, bytes: &[u8]) {
        self.to_say.push_back((at, bytes.to_vec()));
    }

    pub(crate) fn saying(at: Instant, bytes: &[u8]) -> Self {
        let mut talker = Self::default();
        talker.say(at, bytes);
        talker
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.heard.iter().flat_map(|(_, bytes)| bytes.iter().copied()).collect()
    }

    pub(crate) fn times(&self) -> Vec<u64> {
        self.heard.iter().map(|(at, _)| *at).collect()
    }
}

impl Endpoint for Talker {
    type Event = usize;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.heard.push((now.as_micros(), bytes.to_vec()));
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.to_say.front().filter(|(at, _)| now >= *at)?;
        self.saying = self.to_say.pop_front()?.1;
        Some(&self.saying)
    }

    fn poll_event(&mut self) -> Option<usize> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.to_say.front().map(|(at, _)| *at)
    }
}

/// A head that sends `bytes` at 0, and one silent tail.
pub(crate) fn one_way(baud: u32, seed: u64, bytes: &[u8]) -> Line<Talker, Talker> {
    let mut line = Line::new(baud, seed, Talker::saying(at(0), bytes));
    line.add(Talker::default());
    line
}

/// This many random bytes.
pub(crate) fn random_bytes(count: usize) -> Vec<u8> {
    let mut rng = Rng::new(99);
    (0..count).map(|_| rng.byte()).collect()
}
