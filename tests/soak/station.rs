//! A role with an account of its own beside it, and with the clock of its processor.

use axlewire::{
    endpoint::{Arrival, Transmit},
    time::Wrapping32,
};

use super::*;

/// The clock of a station.
pub(crate) enum Clock {
    /// That of the line, 64 bits. The line starts an hour before it wraps.
    Line,
    /// A counter of 32 bits, which wraps every 71 minutes; each station was switched on at another
    /// time.
    Wrapping { wrapping: Wrapping32, ahead: u32 },
}

impl Clock {
    pub(crate) const fn wrapping(ahead: u32) -> Self {
        Self::Wrapping { wrapping: Wrapping32::new(), ahead }
    }
}

/// A role, and what passes by on its way in and out, counted here.
pub(crate) struct Station<E> {
    pub(crate) role: E,
    clock: Clock,
    /// The time of the line and that of the role at the first and at the latest call.
    first: Option<(Instant, Instant)>,
    latest: (Instant, Instant),
    pub(crate) bytes_in: u64,
    pub(crate) bytes_out: u64,
    /// Frames handed out, by kind.
    pub(crate) frames: [u64; 16],
    /// The start of the first frame.
    pub(crate) first_frame: Option<[u8; 8]>,
    kind: fn(&[u8]) -> usize,
    /// The times of the frames to be watched.
    pub(crate) beats: Beats,
}

impl<E> Station<E> {
    pub(crate) fn new(role: E, clock: Clock, kind: fn(&[u8]) -> usize, beats: Beats) -> Self {
        let zero = Instant::from_micros(0);
        Self {
            role,
            clock,
            first: None,
            latest: (zero, zero),
            bytes_in: 0,
            bytes_out: 0,
            frames: [0; 16],
            first_frame: None,
            kind,
            beats,
        }
    }

    /// The time of the role at its latest call.
    pub(crate) const fn role_now(&self) -> Instant {
        self.latest.1
    }

    /// The time of the role at `now`.
    pub(crate) fn at(&mut self, now: Instant) -> Instant {
        let role = match &mut self.clock {
            Clock::Line => now,
            Clock::Wrapping { wrapping, ahead } => {
                wrapping.at((now.as_micros() as u32).wrapping_add(*ahead))
            }
        };
        let (begin, role_begin) = *self.first.get_or_insert((now, role));
        let since = |at: Instant, begin: Instant| at.as_micros().wrapping_sub(begin.as_micros());
        assert_eq!(
            since(now, begin),
            since(role, role_begin),
            "time was lost when a clock wrapped"
        );
        self.latest = (now, role);
        role
    }
}

impl<E: Endpoint> Endpoint for Station<E> {
    type Event = E::Event;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        let now = self.at(now);
        self.bytes_in += bytes.len() as u64;
        self.role.handle_input(bytes, now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        let now = self.at(now);
        self.role.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let role_now = self.at(now);
        let frame = self.role.poll_transmit(role_now)?;
        self.bytes_out += frame.len() as u64;
        self.frames[(self.kind)(frame)] += 1;
        self.beats.note(frame, now);
        if self.first_frame.is_none() {
            let mut start = [0; 8];
            start.iter_mut().zip(frame).for_each(|(start, byte)| *start = *byte);
            self.first_frame = Some(start);
        }
        Some(frame)
    }

    fn is_outdated(&self) -> bool {
        self.role.is_outdated()
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        let now = self.at(now);
        self.role.handle_transmit(outcome, now);
    }

    fn poll_event(&mut self) -> Option<E::Event> {
        self.role.poll_event()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let (now, role_now) = self.latest;
        self.role.poll_timeout().map(|at| now + (at - role_now))
    }
}

/// The times of periodic frames: how late the Nth comes after the start plus N periods.
pub(crate) struct Beats {
    period_us: u64,
    /// The line on which a frame beats, if it does.
    line_of: fn(&[u8]) -> Option<usize>,
    lines: [Beat; 8],
}

#[derive(Clone, Copy, Default)]
struct Beat {
    start: Option<Instant>,
    /// Number of the latest period with a frame, the periods without one, and the frames that were
    /// not the first of their period.
    number: u64,
    missed: u64,
    more: u64,
    latest_lag_us: u64,
}

impl Beats {
    pub(crate) fn new(period_us: u64, line_of: fn(&[u8]) -> Option<usize>) -> Self {
        Self { period_us, line_of, lines: [Beat::default(); 8] }
    }

    pub(crate) fn none() -> Self {
        Self::new(1, |_| None)
    }

    fn note(&mut self, frame: &[u8], now: Instant) {
        let Some(line) = (self.line_of)(frame) else { return };
        let beat = &mut self.lines[line];
        let Some(start) = beat.start else {
            beat.start = Some(now);
            return;
        };
        let since = now.as_micros().wrapping_sub(start.as_micros());
        let number = since / self.period_us;
        if number == beat.number {
            beat.more += 1;
            return;
        }
        beat.missed += number - beat.number - 1;
        (beat.number, beat.latest_lag_us) = (number, since % self.period_us);
    }

    /// The largest lag of the latest frames of all lines.
    pub(crate) fn lag_us(&self) -> u64 {
        self.lines.iter().map(|beat| beat.latest_lag_us).max().unwrap_or_default()
    }

    /// Periods since the start, and those of them without a frame, of all lines.
    pub(crate) fn periods(&self) -> (u64, u64) {
        let sum = |value: fn(&Beat) -> u64| self.lines.iter().map(value).sum();
        (sum(|beat| beat.number), sum(|beat| beat.missed))
    }
}
