//! The simulator, on which many tests rely: bytes are conserved and in time, the same seed gives
//! the same line, an endpoint that breaks its contract is found out, and motors obey physics.

mod physics;

use std::collections::VecDeque;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    endpoint::{Arrival, Endpoint},
    sim::{Direction, Faults, Input, Line, Stuck, Who, Wire},
    time::{Duration, Instant},
};

use super::Tally;

#[derive(Arbitrary, Debug)]
enum Plan<'a> {
    Line(LinePlan<'a>),
    Wire { faults: Rates, seed: u64, sends: Vec<(u16, u8)> },
    Breach { is_endless: bool, after: u8 },
    Motor { speed: i8, limit: u8, constant_ms: u8, steps: Vec<(u8, u16)> },
    Rover { battery: u8, steps: Vec<(i8, i8, u16)> },
}

#[derive(Arbitrary, Clone, Copy, Debug)]
struct Rates {
    bit_errors: u8,
    lost: u8,
    duplicated: u8,
    inserted: u8,
    stray: Option<u8>,
    delay_us: u16,
    jitter_us: u16,
    echo: bool,
}

impl Rates {
    fn faults(self) -> Faults {
        let rate = |value: u8| if value < 128 { 0.0 } else { f64::from(value - 127) / 256.0 };
        let mut faults = Faults::noise(rate(self.bit_errors));
        faults.lost = rate(self.lost);
        faults.duplicated = rate(self.duplicated);
        faults.inserted = rate(self.inserted);
        (faults.stray, faults.echo) = (self.stray, self.echo);
        faults.delay = Duration::from_micros(self.delay_us.into());
        faults.jitter = Duration::from_micros(self.jitter_us.into());
        faults
    }
}

#[derive(Arbitrary, Debug)]
struct LinePlan<'a> {
    seed: u64,
    baud: u8,
    wraps: bool,
    faults: [Rates; 3],
    is_clean: bool,
    pieces: u8,
    latency_us: u8,
    /// Who sends how many bytes, and how long after the previous.
    sends: Vec<(bool, u8, u16)>,
    bytes: &'a [u8],
}

pub(super) fn sim_line(data: &[u8], tally: &mut Tally) {
    let _ = play(&mut Unstructured::new(data), tally);
}

fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let kind = match u.arbitrary()? {
        Plan::Line(plan) => {
            let (first, again) = (run(&plan), run(&plan));
            assert_eq!(first, again, "the same seed gives another line");
            if plan.is_clean { 0 } else { 1 }
        }
        Plan::Wire { faults, seed, sends } => {
            wire(faults, seed, &sends);
            2
        }
        Plan::Breach { is_endless, after } => {
            breach(is_endless, after);
            3 + u8::from(is_endless)
        }
        Plan::Motor { speed, limit, constant_ms, steps } => {
            physics::motor(speed, limit, constant_ms, &steps);
            5
        }
        Plan::Rover { battery, steps } => {
            physics::rover(battery, &steps);
            6
        }
    };
    tally.did(kind);
    Ok(())
}

/// Sends what it is told to, and notes what it hears.
#[derive(Debug, Default)]
struct Talker {
    outbox: VecDeque<Vec<u8>>,
    packet: Vec<u8>,
    heard: Vec<(Instant, u8)>,
}

impl Endpoint for Talker {
    type Event = ();

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.heard.extend(bytes.iter().map(|&byte| (now, byte)));
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        self.packet = self.outbox.pop_front()?;
        Some(&self.packet)
    }

    fn poll_event(&mut self) -> Option<()> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}

/// Runs the plan; returns what both ends have heard.
fn run(plan: &LinePlan<'_>) -> [Vec<(Instant, u8)>; 2] {
    let baud = [500_000, 115_200, 9600, 1_000_000][usize::from(plan.baud % 4)];
    let begin = Instant::from_micros(if plan.wraps { u64::MAX - 3000 } else { 0 });
    let mut line =
        Line::<Talker, Talker>::new(baud, plan.seed, Talker::default()).starting_at(begin);
    line.add(Talker::default());
    let mut faults = plan.faults.map(Rates::faults);
    if plan.is_clean {
        faults = [Faults::CLEAN; 3];
    }
    *line.pair_mut(Direction::ToTails) = faults[0];
    *line.pair_mut(Direction::ToHead) = faults[1];
    *line.stub_mut(Who::Tail(0)) = faults[2];
    let pause = Duration::from_micros(50);
    for who in [Who::Head, Who::Tail(0)] {
        let timing = line.timing_mut(who);
        timing.latency = Duration::from_micros(u32::from(plan.latency_us % 100));
        timing.input = match plan.pieces % 3 {
            0 => Input::Bytes,
            1 => Input::AfterPause { pause, at_most: usize::from(plan.pieces / 3) },
            _ => Input::AfterFirst { wait: pause, at_most: usize::from(plan.pieces / 3) },
        };
    }
    line.record();
    let mut sent = [Vec::new(), Vec::new()];
    let mut bytes = plan.bytes.iter().copied().cycle();
    for &(is_tail, count, after) in plan.sends.iter().take(20) {
        line.run_for(Duration::from_micros(after.into())).expect("a talker keeps the contract");
        let packet: Vec<u8> = bytes.by_ref().take(usize::from(count % 40)).collect();
        sent[usize::from(is_tail)].push((line.now(), packet.len()));
        let talker = if is_tail { line.tail_mut(0) } else { line.head_mut() };
        talker.outbox.extend((!packet.is_empty()).then_some(packet));
    }
    line.run_for(Duration::from_millis(3000)).expect("a talker keeps the contract");
    assert!(line.next().is_none(), "something is still due after everything has arrived");

    let elapsed = u64::from((line.now() - begin).as_micros());
    let heard = [line.head().heard.clone(), line.tail(0).heard.clone()];
    for (direction, from) in [(Direction::ToHead, 1), (Direction::ToTails, 0)] {
        let counts = *line.statistics(direction);
        let total: usize = sent[from].iter().map(|(_, count)| count).sum();
        assert_eq!(counts.bytes, total as u64);
        // One station on each end: what is neither lost nor added arrives. An echo comes on top.
        let is_echoed = faults[2].echo || faults.iter().any(|faults| faults.echo);
        if !is_echoed {
            let arrives = counts.bytes + counts.duplicated + counts.inserted - counts.lost;
            assert_eq!(heard[1 - from].len() as u64, arrives, "{counts:?}");
        }
        assert!(counts.busy_us <= elapsed && counts.collided == 0);
        let wire_us = (total as u64 * 10_000_000).div_ceil(u64::from(baud));
        assert!(counts.busy_us.abs_diff(wire_us) <= total as u64 + 1, "{counts:?}: {wire_us}");
        assert!(line.polls(Who::Head) <= 2 * (heard[0].len() + 60) as u64);
    }
    for heard in &heard {
        assert!(heard.windows(2).all(|pair| pair[0].0 <= pair[1].0), "time goes backwards");
    }
    if plan.is_clean {
        let mut bytes = plan.bytes.iter().copied().cycle();
        let mut spoken = [Vec::new(), Vec::new()];
        for &(is_tail, count, _) in plan.sends.iter().take(20) {
            spoken[usize::from(!is_tail)].extend(bytes.by_ref().take(usize::from(count % 40)));
        }
        for end in 0..2 {
            let told: Vec<u8> = heard[end].iter().map(|&(_, byte)| byte).collect();
            assert_eq!(told, spoken[end], "a clean line changes bytes");
        }
    }
    heard
}

/// A wire in real time conserves bytes and keeps their order and delay.
fn wire(rates: Rates, seed: u64, sends: &[(u16, u8)]) {
    let faults = rates.faults();
    let mut wire = Wire::new(faults, seed);
    let mut now = Instant::from_micros(u64::MAX - 1000);
    let (mut sent, mut heard, mut buffer) = (0, 0, [0; 7]);
    for &(after, count) in sends.iter().take(30) {
        now += Duration::from_micros(after.into());
        let packet: Vec<u8> = (0..count % 32).collect();
        let echo = wire.send(&packet, now).len();
        assert!(faults.echo || echo == 0);
        sent += packet.len() as u64;
        // Nothing arrives early, and all that is due comes, in pieces of any size.
        let due = wire.next().is_some_and(|at| at <= now);
        let got = wire.receive(&mut buffer, now);
        assert_eq!(got > 0, due);
        heard += got as u64;
    }
    let last = now + faults.delay + faults.jitter;
    loop {
        let got = wire.receive(&mut buffer, last) as u64;
        if got == 0 {
            break;
        }
        heard += got;
    }
    assert_eq!(wire.next(), None, "something is later than its delay");
    let counts = wire.statistics();
    assert_eq!(counts.bytes, sent);
    assert_eq!(heard, sent + counts.duplicated + counts.inserted - counts.lost);
}

/// An endpoint that breaks the contract after some good calls.
#[derive(Debug)]
struct Bad {
    is_endless: bool,
    after: u8,
    now: Instant,
}

impl Endpoint for Bad {
    type Event = ();

    fn handle_input(&mut self, _: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.now = now;
    }

    fn handle_timeout(&mut self, now: Instant) {
        (self.now, self.after) = (now, self.after.saturating_sub(1));
    }

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        (self.is_endless && self.after == 0).then_some(&[1])
    }

    fn poll_event(&mut self) -> Option<()> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        // A deadline that stays where it is when it has been reached.
        let wait = if self.after == 0 { 0 } else { 10 };
        Some(self.now + Duration::from_micros(wait))
    }
}

fn breach(is_endless: bool, after: u8) {
    let now = Instant::from_micros(0);
    let mut line = Line::<Bad, Talker>::new(500_000, 1, Bad { is_endless, after: after % 50, now });
    let stuck = line.run_for(Duration::from_millis(50)).expect_err("a breach of the contract");
    match stuck {
        Stuck::Endless { who, .. } => assert!(is_endless && who == Who::Head),
        Stuck::BusyLoop { who, .. } => assert!(!is_endless && who == Who::Head),
        other => panic!("{other}"),
    }
    assert!(!stuck.to_string().is_empty());
    assert!(line.polls(Who::Head) <= 2 * 50 + 20_000, "found out too late");
}
