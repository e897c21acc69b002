//! A role that a page drives.

use std::collections::VecDeque;

use axlewire::{
    endpoint::{Arrival, Endpoint, Unsent},
    time::{Duration, Instant},
};
use serde_json::{Value, json};

/// A turn of the page's loop that comes so late that received bytes may have waited meanwhile.
const LATE: Duration = Duration::from_millis(30);

/// Time behind such a turn in which bytes that have waited are still handed over: messages of the
/// browser are not in the order of their times.
const BACKLOG: Duration = Duration::from_millis(100);

/// Events that a page may fetch late: a hidden one draws nothing.
const MOST_EVENTS: usize = 1000;

/// An event at a time as a sentence for people, if it is worth one.
type Told<E> = Box<dyn FnMut(f64, &E) -> Option<Value>>;

/// A role, and what it has reported.
pub(crate) struct Session<R: Endpoint> {
    pub(crate) role: R,
    told: Told<R::Event>,
    /// The latest.
    events: VecDeque<Value>,
    /// The latest turn of the page's loop.
    turn: Instant,
    /// The last turn before the page was held up, and when its backlog is over.
    held_up: Option<(Instant, Instant)>,
}

/// The time of the page.
pub(crate) fn instant(now: f64) -> Instant {
    Instant::from_micros((now * 1e3) as u64)
}

/// A span in milliseconds.
pub(crate) fn span(ms: f64) -> Duration {
    Duration::from_micros((ms * 1e3) as u32)
}

impl<R: Endpoint> Session<R> {
    pub(crate) fn new(
        role: R,
        told: impl FnMut(f64, &R::Event) -> Option<Value> + 'static,
        now: f64,
    ) -> Self {
        Self {
            role,
            told: Box::new(told),
            events: VecDeque::new(),
            turn: instant(now),
            held_up: None,
        }
    }

    /// Takes in received bytes. If the page was held up, they may have waited.
    pub(crate) fn receive(&mut self, bytes: &[u8], now: f64) {
        self.take_turn(now);
        match self.held_up {
            Some((since, _)) => {
                self.role.handle_input(bytes, Arrival::Between { since, now: self.turn });
            }
            None => self.role.handle_input(bytes, self.turn),
        }
    }

    fn take_turn(&mut self, now: f64) {
        let now = instant(now);
        if now >= self.turn + LATE {
            let since = self.held_up.map_or(self.turn, |(since, _)| since);
            self.held_up = Some((since, now + BACKLOG));
        } else {
            self.held_up = self.held_up.filter(|(_, end)| now < *end);
        }
        self.turn = now;
    }

    /// What was due by now happens, such as a dead-man. Gives what has happened.
    pub(crate) fn catch_up(&mut self, now: f64) -> Vec<R::Event> {
        let mut all = Vec::new();
        let at = instant(now);
        if self.role.poll_timeout().is_some_and(|timeout| timeout <= at) {
            self.role.handle_timeout(at);
        }
        while let Some(event) = self.role.poll_event() {
            if let Some(told) = (self.told)(now, &event) {
                self.events.truncate(MOST_EVENTS - 1);
                self.events.push_front(told);
            }
            all.push(event);
        }
        all
    }

    /// The next frame to write, if one is due.
    pub(crate) fn transmit(&mut self, now: f64) -> Option<Vec<u8>> {
        self.take_turn(now);
        drop(self.catch_up(now));
        self.role.poll_transmit(self.turn).map(<[u8]>::to_vec)
    }

    /// The latest events since the last call, the oldest first.
    pub(crate) fn events(&mut self) -> String {
        json!(self.events.drain(..).rev().collect::<Vec<_>>()).to_string()
    }

    /// A frame was written, or nobody knows how much of it.
    pub(crate) fn sent(&mut self, ok: bool, now: f64) {
        if !ok {
            self.role.handle_transmit(Unsent::CutOff, instant(now));
        }
    }

    /// Milliseconds until the next turn is due, even if nothing is received.
    pub(crate) fn wait(&self, now: f64) -> Option<f64> {
        let at = self.role.poll_timeout()?;
        Some((at.as_micros() as f64 / 1e3 - now).max(0.0))
    }
}
