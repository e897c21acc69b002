//! A line in virtual time that carries frames instead of bytes: ten times as fast as
//! `axlewire::sim::Line`, which a year needs.
//!
//! It drives its endpoints in the same order, and with the wires of the simulator: noise, lost and
//! made-up bytes are those of `axlewire::sim::Wire`. A frame arrives in one piece when its last
//! byte would; a plug that falls out cuts the frame where it is. Frames of two tails at once do not
//! garble each other; `campaign` and `models` test that.

use axlewire::{sim::Wire, time::wire_time};

use super::*;

const LONGEST: usize = 64;
const TAILS: usize = 8;

/// A frame on its way.
#[derive(Clone, Copy)]
struct Flight {
    start: Instant,
    end: Instant,
    /// 0 is the head.
    from: usize,
    bytes: [u8; LONGEST],
    len: usize,
    /// How much of it each tail hears, or the head in place of the tail that sent it.
    heard: [usize; TAILS],
}

pub(crate) struct Lane<H: Endpoint, T: Endpoint> {
    head: H,
    tails: Vec<T>,
    /// Of the head, then of the tails: the time of the next round.
    due: Vec<Option<Instant>>,
    flights: Vec<Flight>,
    /// To the tails and to the head.
    busy_until: [Instant; 2],
    pairs: [Wire; 2],
    is_clean: bool,
    is_unplugged: [bool; TAILS],
    baud: u32,
    late_us: u64,
    rng: Rng,
    start: Instant,
    now: Instant,
    head_events: Vec<(Instant, H::Event)>,
    rounds_at_once: u32,
}

impl<H: Endpoint, T: Endpoint> Lane<H, T> {
    /// A clean line whose loops notice up to `late_us` too late that a time has come.
    pub(crate) fn new(
        baud: u32,
        late_us: u64,
        seed: u64,
        now: Instant,
        head: H,
        tails: Vec<T>,
    ) -> Self {
        Self {
            due: vec![Some(now); tails.len() + 1],
            head,
            tails,
            flights: Vec::new(),
            busy_until: [now; 2],
            pairs: [1, 2].map(|pair| Wire::new(Faults::CLEAN, seed ^ pair)),
            is_clean: true,
            is_unplugged: [false; TAILS],
            baud,
            late_us,
            rng: Rng::new(seed),
            start: now,
            now,
            head_events: Vec::new(),
            rounds_at_once: 0,
        }
    }

    pub(crate) const fn now(&self) -> Instant {
        self.now
    }

    /// Microseconds since the start.
    pub(crate) const fn elapsed(&self) -> u64 {
        self.since_start(self.now)
    }

    pub(crate) const fn since_start(&self, at: Instant) -> u64 {
        at.as_micros().wrapping_sub(self.start.as_micros())
    }

    pub(crate) const fn head(&self) -> &H {
        &self.head
    }

    /// The head, to give it commands. It then has another round.
    pub(crate) fn head_mut(&mut self) -> &mut H {
        self.due[0] = Some(self.now);
        &mut self.head
    }

    pub(crate) fn tails(&self) -> &[T] {
        &self.tails
    }

    pub(crate) fn tail(&self, index: usize) -> &T {
        &self.tails[index]
    }

    pub(crate) fn tail_mut(&mut self, index: usize) -> &mut T {
        self.due[index + 1] = Some(self.now);
        &mut self.tails[index]
    }

    pub(crate) fn take_head_events(&mut self) -> Vec<(Instant, H::Event)> {
        std::mem::take(&mut self.head_events)
    }

    pub(crate) fn is_silent(&self) -> bool {
        self.flights.is_empty()
    }

    /// The faults of both directions from now on.
    pub(crate) fn set_faults(&mut self, faults: Faults) {
        self.is_clean = faults == Faults::CLEAN;
        for pair in &mut self.pairs {
            *pair.faults_mut() = faults;
        }
    }

    /// Cuts a tail off, in the middle of a frame if there is one, or connects it again.
    pub(crate) fn set_unplugged(&mut self, tail: usize, is_unplugged: bool) {
        let was_unplugged = std::mem::replace(&mut self.is_unplugged[tail], is_unplugged);
        if is_unplugged && !was_unplugged {
            let byte = wire_time(1, self.baud).as_micros();
            for flight in &mut self.flights {
                if flight.from == 0 || flight.from == tail + 1 {
                    let sent = (self.now - flight.start).as_micros() / byte;
                    flight.heard[tail] = flight.heard[tail].min(sent as usize);
                }
            }
        }
    }

    /// When something is due.
    fn next(&self) -> Option<Instant> {
        let flights = self.flights.iter().map(|flight| flight.end);
        let next = self.due.iter().flatten().copied().chain(flights).reduce(Instant::min);
        next.map(|at| at.max(self.now))
    }

    /// Runs what is due next, unless that is after `end`; returns whether anything was.
    pub(crate) fn step(&mut self, end: Instant) -> bool {
        let Some(at) = self.next().filter(|at| *at <= end) else { return false };
        self.rounds_at_once = if at == self.now { self.rounds_at_once + 1 } else { 0 };
        assert!(self.rounds_at_once < 1000, "a driver would spin at {at:?}");
        self.now = at;
        while let Some(index) = self.flights.iter().position(|flight| flight.end <= at) {
            let flight = self.flights.remove(index);
            self.arrive(&flight);
        }
        for port in 0..self.due.len() {
            if self.due[port].is_some_and(|due| due <= at) {
                self.run(port);
            }
        }
        true
    }

    pub(crate) fn run_until(&mut self, end: Instant) {
        while self.step(end) {}
        self.now = self.now.max(end);
    }

    /// Until this many microseconds after the start.
    pub(crate) fn run_to(&mut self, micros: u64) {
        self.run_until(Instant::from_micros(self.start.as_micros().wrapping_add(micros)));
    }

    pub(crate) fn run_for(&mut self, span: Duration) {
        self.run_until(self.now + span);
    }

    fn arrive(&mut self, flight: &Flight) {
        let (now, mut buffer) = (self.now, [0; 4 * LONGEST]);
        let direction = usize::from(flight.from != 0);
        let bytes = &flight.bytes[..flight.len];
        if flight.from != 0 {
            let heard = &bytes[..flight.heard[flight.from - 1].min(flight.len)];
            let through = pass(&mut self.pairs[direction], self.is_clean, heard, now, &mut buffer);
            if !through.is_empty() {
                self.head.handle_input(through, now);
                self.due[0] = Some(now);
            }
            return;
        }
        let through = pass(&mut self.pairs[direction], self.is_clean, bytes, now, &mut buffer);
        for (index, tail) in self.tails.iter_mut().enumerate() {
            let heard = &through[..flight.heard[index].min(through.len())];
            if !heard.is_empty() {
                tail.handle_input(heard, now);
                self.due[index + 1] = Some(now);
            }
        }
    }

    fn run(&mut self, port: usize) {
        let now = self.now;
        if port == 0 {
            if self.head.poll_timeout().is_some_and(|at| at <= now) {
                self.head.handle_timeout(now);
            }
            while let Some(event) = self.head.poll_event() {
                self.head_events.push((now, event));
            }
            while let Some(frame) = self.head.poll_transmit(now) {
                let mut heard = [usize::MAX; TAILS];
                for (heard, is_unplugged) in heard.iter_mut().zip(self.is_unplugged) {
                    *heard = if is_unplugged { 0 } else { usize::MAX };
                }
                let busy = &mut self.busy_until[0];
                self.flights.push(flight(0, frame, heard, now, busy, self.baud));
            }
            self.due[0] = {
                let due = self.head.poll_timeout();
                self.noticed(due)
            };
            return;
        }
        let tail = &mut self.tails[port - 1];
        if tail.poll_timeout().is_some_and(|at| at <= now) {
            tail.handle_timeout(now);
        }
        while tail.poll_event().is_some() {}
        while let Some(frame) = tail.poll_transmit(now) {
            let heard = if self.is_unplugged[port - 1] { 0 } else { usize::MAX };
            let busy = &mut self.busy_until[1];
            self.flights.push(flight(port, frame, [heard; TAILS], now, busy, self.baud));
        }
        let due = tail.poll_timeout();
        self.due[port] = self.noticed(due);
    }

    /// When the loop around a role notices that this time has come.
    fn noticed(&mut self, due: Option<Instant>) -> Option<Instant> {
        let late = self.rng.below(self.late_us + 1) as u32;
        due.map(|at| at + Duration::from_micros(late))
    }
}

/// A frame that leaves once the pair is free.
fn flight(
    from: usize,
    frame: &[u8],
    heard: [usize; TAILS],
    now: Instant,
    busy_until: &mut Instant,
    baud: u32,
) -> Flight {
    let start = now.max(*busy_until);
    let end = start + wire_time(frame.len(), baud);
    *busy_until = end;
    let mut bytes = [0; LONGEST];
    bytes[..frame.len()].copy_from_slice(frame);
    Flight { start, end, from, bytes, len: frame.len(), heard }
}

/// What comes out of a pair.
fn pass<'a>(
    pair: &mut Wire,
    is_clean: bool,
    bytes: &'a [u8],
    now: Instant,
    buffer: &'a mut [u8],
) -> &'a [u8] {
    if is_clean {
        return bytes;
    }
    pair.send(bytes, now);
    let count = pair.receive(buffer, now);
    &buffer[..count]
}
