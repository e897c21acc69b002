//! A session of a rover's link: a host and its robot.

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    endpoint::{Arrival, Endpoint, Unsent},
    time::{Duration, Instant},
    ucp::{
        Host, Robot, Telemetry,
        host::{HostConfig, MemoryStore},
        robot::{ReportLayout, RobotConfig},
    },
};

mod actions;
mod checks;
mod end;

use super::{
    ACTIONS, Tally,
    ears::{Ears, Found},
    oracle::Rules,
    way::{Piece, Way},
};

#[derive(Arbitrary, Clone, Copy, Debug)]
struct Setup {
    start: u8,
    is_direct: bool,
    is_document: bool,
    pings: bool,
    low_ids_only: bool,
    few_reports: bool,
}

const US: fn(u32) -> Duration = Duration::from_micros;
const MS: fn(u32) -> Duration = Duration::from_millis;

/// One end of the line: what it hears, and how its port behaves.
struct End {
    ears: Ears,
    unheard: usize,
    given: u64,
    fail: Option<(Unsent, usize)>,
    asleep_until: Instant,
    /// When its port was last seen empty.
    seen_at: Instant,
}

impl End {
    fn new(now: Instant) -> Self {
        let ears = Ears::new(Rules::Ucp { cap: 60 });
        Self { ears, unheard: 0, given: 0, fail: None, asleep_until: now, seen_at: now }
    }
}

pub(super) struct Link {
    pub(super) now: Instant,
    pub(super) host: Host<MemoryStore>,
    pub(super) robot: Robot,
    host_config: HostConfig,
    robot_config: RobotConfig,
    ends: [End; 2],
    /// To the host and to the robot.
    ways: [Way; 2],
    frames: [Vec<Vec<u8>>; 2],
    is_plugged: bool,
    /// The latest command of the application, unless it is a stop.
    wanted: Option<((i16, i16), Instant)>,
    has_stopped: bool,
    /// The last motor frame that has left, and when.
    told: Option<((i16, i16), Instant)>,
    is_first: bool,
    /// Motor commands that the robot has heard.
    pub(super) heard: Vec<((i16, i16), Instant)>,
    telemetry: Telemetry,
    reported: Vec<Telemetry>,
    results: i16,
    pub(super) is_over: bool,
    /// Virtual time that the actions may still take.
    budget: Duration,
    fruitful: u64,
    fruitless: u64,
}

pub(super) fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let mut link = Link::new(u.arbitrary()?);
    let begin = link.now;
    for _ in 0..ACTIONS {
        if u.is_empty() {
            break;
        }
        let kind = link.perform(u.arbitrary()?);
        if link.is_over {
            tally.did(40);
            return Ok(());
        }
        tally.did(22 + kind);
    }
    end::check(&mut link);
    let elapsed = u64::from((link.now - begin).as_micros());
    assert!(link.fruitless <= 20 + 4 * link.fruitful + elapsed / 1000, "{}", link.fruitless);
    tally.did(if link.is_over { 40 } else { 41 });
    Ok(())
}

const HOST: usize = 0;
const ROBOT: usize = 1;

impl Link {
    fn new(setup: Setup) -> Self {
        let start =
            [0, u64::MAX - 300_000, u64::MAX / 2 - 300_000, 1 << 40][usize::from(setup.start % 4)];
        let now = Instant::from_micros(start);
        let mut host_config =
            if setup.is_direct { HostConfig::direct() } else { HostConfig::usb_adapter() };
        host_config.ping_period = setup.pings.then_some(MS(200));
        host_config.low_ids_only = setup.low_ids_only;
        let mut robot_config = RobotConfig::direct();
        if setup.is_document {
            robot_config.layout = ReportLayout::Document;
        }
        if setup.few_reports {
            robot_config.report_period = MS(150);
        }
        let mut link = Self {
            now,
            host: Host::with_store(host_config, MemoryStore::default(), now),
            robot: Robot::new(robot_config, now),
            host_config,
            robot_config,
            ends: [End::new(now), End::new(now)],
            ways: [Way::new(87, 5000), Way::new(87, 5000)],
            frames: [Vec::new(), Vec::new()],
            is_plugged: true,
            wanted: None,
            has_stopped: true,
            told: None,
            is_first: true,
            heard: Vec::new(),
            telemetry: Telemetry::default(),
            reported: Vec::new(),
            results: 0,
            is_over: false,
            budget: MS(1500),
            fruitful: 1,
            fruitless: 0,
        };
        link.measure();
        link
    }

    pub(super) fn run_for(&mut self, span: Duration) {
        let end = self.now + span;
        while !self.is_over {
            let Some(at) = self.next_at().filter(|at| *at <= end) else { break };
            self.now = self.now.max(at);
            let before = self.fruitful;
            for end in [HOST, ROBOT] {
                if self.now >= self.ends[end].asleep_until && !self.is_over {
                    self.serve(end);
                }
            }
            self.fruitless += u64::from(self.fruitful == before);
        }
        self.now = self.now.max(end);
        self.check_robot();
    }

    fn next_at(&self) -> Option<Instant> {
        let timeouts = [self.host.poll_timeout(), self.robot.poll_timeout()];
        let of = |end: usize| {
            let all = [self.ways[end].next_at(), timeouts[end]].into_iter().flatten();
            all.min().map(|at| at.max(self.ends[end].asleep_until))
        };
        [of(HOST), of(ROBOT)].into_iter().flatten().min()
    }

    fn serve(&mut self, end: usize) {
        while let Some(piece) = self.ways[end].arrived(self.now) {
            self.fruitful += 1;
            if self.is_plugged {
                self.hear(end, &piece);
            }
            if self.is_over {
                return;
            }
        }
        self.ends[end].seen_at = self.now;
        if end == HOST {
            let counters = self.host.counters();
            serve_timeout(&mut self.host, self.now);
            self.took(HOST, self.host.counters().frames - counters.frames);
            let events: Vec<_> = core::iter::from_fn(|| self.host.poll_event()).collect();
            self.fruitful += events.len() as u64;
            self.check_events(&events);
        } else {
            let counters = self.robot.counters();
            serve_timeout(&mut self.robot, self.now);
            self.took(ROBOT, self.robot.counters().frames - counters.frames);
            while self.robot.poll_event().is_some() {
                self.fruitful += 1;
            }
            self.check_robot();
        }
        self.check_account(end);
        self.send(end);
    }

    fn hear(&mut self, end: usize, piece: &Piece) {
        let mut motion = None;
        for found in self.ends[end].ears.take(&piece.bytes) {
            let Found::Sent(number) = found else { return self.is_over = true };
            self.ends[end].unheard += 1;
            let frame = &self.frames[end][number as usize];
            if let (ROBOT, Some(told)) = (end, motion_of(frame)) {
                self.heard.push((told, self.now));
                motion = (frame.len() == piece.bytes.len()).then_some(told);
            }
        }
        let bytes: Vec<u8> = piece.bytes.iter().map(|carried| carried.byte).collect();
        self.ends[end].given += bytes.len() as u64;
        let before;
        if end == HOST {
            before = self.host.counters();
            self.host.handle_input(&bytes, self.now);
            self.took(end, self.host.counters().frames - before.frames);
        } else {
            before = self.robot.counters();
            let since = self.ends[end].seen_at;
            // As a driver does that was held up.
            match self.now - since > MS(20) && self.ends[end].asleep_until > since {
                true => self.robot.handle_input(&bytes, Arrival::Between { since, now: self.now }),
                false => self.robot.handle_input(&bytes, self.now),
            }
            self.took(end, self.robot.counters().frames - before.frames);
            let is_at_once = before.framed + before.skipped() == before.received;
            if let (Some(told), true) = (motion.filter(|_| is_at_once), since == self.now) {
                let doing = self.robot.command(self.now);
                assert_eq!((doing.speed(), doing.angular()), told, "a command is not obeyed");
            }
        }
    }

    fn send(&mut self, end: usize) {
        let other = 1 - end;
        let mut is_clean = true;
        for count in 0.. {
            assert!(count < 20, "it never stops sending");
            let frame = match end {
                HOST => self.host.poll_transmit(self.now).map(<[u8]>::to_vec),
                _ => self.robot.poll_transmit(self.now).map(<[u8]>::to_vec),
            };
            let Some(frame) = frame else { break };
            self.fruitful += 1;
            self.check_frame(end, &frame);
            let number = self.frames[other].len() as u64;
            self.frames[other].push(frame.clone());
            let (unsent, len) = match self.ends[end].fail.take() {
                None => (None, frame.len()),
                Some((Unsent::Untouched, _)) => (Some(Unsent::Untouched), 0),
                Some((Unsent::CutOff, cut)) => (Some(Unsent::CutOff), 1 + cut % (frame.len() - 1)),
                Some((unflushed, _)) => (Some(unflushed), frame.len()),
            };
            if len > 0 {
                self.ways[other].send(&frame[..len], number, self.now);
            }
            let Some(unsent) = unsent else { continue };
            is_clean = false;
            match end {
                HOST => {
                    self.told = None;
                    self.host.handle_transmit(unsent, self.now);
                }
                _ => self.robot.handle_transmit(unsent, self.now),
            }
            break;
        }
        if end == HOST {
            assert!(self.host.poll_timeout().is_none_or(|at| at > self.now || !is_clean));
            if is_clean {
                self.check_told();
            }
        } else {
            self.measure();
        }
    }
}

fn serve_timeout<R: Endpoint>(role: &mut R, now: Instant) {
    if role.poll_timeout().is_some_and(|at| now >= at) {
        role.handle_timeout(now);
    }
}

fn motion_of(frame: &[u8]) -> Option<(i16, i16)> {
    let percent = |at: usize| i16::from_le_bytes([frame[at], frame[at + 1]]);
    (frame.len() == 24 && frame[4] == 2).then(|| (percent(6), percent(8)))
}
