//! A host with its robot on a line with faults.

use axlewire::{
    sim::RoverNode,
    ucp::{
        Host, MotorControl, Robot,
        host::{CommandError, HostConfig, HostEvent},
        robot::RobotConfig,
    },
};

use super::*;

/// The id of a frame.
fn kind(frame: &[u8]) -> usize {
    usize::from(frame[4] & 15)
}

pub(crate) const PING: usize = 1;
pub(crate) const MOTOR: usize = 2;
pub(crate) const REPORT: usize = 5;

/// How late the loops notice that a time has come, at most.
pub(crate) const LATE_US: u64 = 200;

pub(crate) type Head = Station<Host>;
pub(crate) type Tail = Station<RoverNode>;

/// What the application does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Order {
    Drive(MotorControl),
    Stop,
    /// It hangs, and calls the host no more.
    Hang,
}

pub(crate) struct Link {
    pub(crate) plan: Plan,
    pub(crate) line: Lane<Head, Tail>,
    pub(crate) schedule: Schedule,
    rng: Rng,
    pub(crate) order: Order,
    /// When it was given, since when there is no fault, and since when the robot is cut off.
    pub(crate) ordered_us: u64,
    pub(crate) quiet_us: u64,
    pub(crate) cut_off_us: Option<u64>,
    /// Counts at the last look, if there was no fault since.
    pub(crate) flow: Option<[u64; 7]>,
    pub(crate) looks: u64,
    pub(crate) account: Account,
}

impl Link {
    pub(crate) fn new(plan: Plan) -> Self {
        let start = plan.start();
        let mut rng = Rng::new(plan.seed ^ 0xA99);
        let tail = tail(&plan, start, &mut rng);
        Self {
            line: Lane::new(115_200, LATE_US, plan.seed, start, head(&plan, start), vec![tail]),
            schedule: Schedule::new(&plan, 1, End::Tails),
            rng,
            order: Order::Stop,
            ordered_us: 0,
            quiet_us: 0,
            cut_off_us: None,
            flow: None,
            looks: 0,
            account: Account::default(),
            plan,
        }
    }

    pub(crate) fn host(&self) -> &Host {
        &self.line.head().role
    }

    pub(crate) fn robot(&self) -> &Robot {
        self.line.tail(0).role.robot()
    }

    /// Runs to the end of the plan.
    pub(crate) fn run(&mut self) {
        while self.line.elapsed() < self.plan.length_us {
            self.command();
            let step_end = (self.line.elapsed() / self.plan.step_us + 1) * self.plan.step_us;
            while let Some(edge) = self.schedule.edge_before(step_end) {
                self.line.run_to(edge);
                self.change();
            }
            self.line.run_to(step_end);
            // A rover is simulated up to the last call of its robot.
            let now = self.line.now();
            self.line.tail_mut(0).handle_input(&[], now);
            self.react();
            self.check();
        }
        self.account.faults = self.schedule.counts;
        self.check_host_sums();
        self.check_robot_sums();
        self.close_beats();
    }

    /// Lets faults end and begin.
    fn change(&mut self) {
        let now = self.line.elapsed();
        for fault in self.schedule.ended(now) {
            if let Fault::BrownOut(_) = fault {
                self.reset();
            }
            self.account.reliefs += 1;
        }
        if let Some(fault) = self.schedule.begun(now) {
            if let Some(micros) = self.schedule.micros_into_a_frame() {
                let limit = self.line.now() + Duration::from_millis(1000);
                while self.line.is_silent() && self.line.step(limit) {}
                self.line.run_for(Duration::from_micros(10 * micros as u32));
            }
            match fault {
                Fault::Reset(_) => self.reset(),
                Fault::ResetHead => self.reset_head(),
                _ => {}
            }
        }
        let pair = self.schedule.pair();
        let is_cut_off = self.schedule.is_cut_off(0);
        self.line.set_unplugged(0, is_cut_off);
        self.line.set_faults(pair);
        let now = self.line.elapsed();
        let since = self.cut_off_us.unwrap_or(now);
        self.cut_off_us = (is_cut_off || pair.unplugged).then_some(since);
        self.quiet_us = now;
        self.flow = None;
    }

    fn reset(&mut self) {
        self.check_robot_sums();
        self.close_beats();
        let now = self.line.now();
        *self.line.tail_mut(0) = tail(&self.plan, now, &mut self.rng);
        self.account.resets += 1;
    }

    fn reset_head(&mut self) {
        self.check_host_sums();
        let now = self.line.now();
        *self.line.head_mut() = head(&self.plan, now);
        (self.order, self.ordered_us) = (Order::Stop, self.line.elapsed());
        self.account.head_resets += 1;
    }

    /// The application: the same order again, or now and then another.
    fn command(&mut self) {
        let now = self.line.now();
        if self.rng.below(self.plan.orders_every) == 0 {
            let mut percent = || self.rng.below(201) as i16 - 100;
            let drive = Order::Drive(MotorControl::new(percent(), percent()).unwrap());
            self.order = match self.rng.below(8) {
                0..4 => drive,
                4..7 => Order::Stop,
                _ => Order::Hang,
            };
            self.ordered_us = self.line.elapsed();
            let kind = usize::from(self.order == Order::Stop);
            self.account.orders[kind] += 1;
            if self.order == Order::Stop {
                self.line.head_mut().role.stop(now);
            }
        }
        if let Order::Drive(command) = self.order {
            let driven = self.line.head_mut().role.drive(command, now);
            assert!(matches!(driven, Ok(()) | Err(CommandError::LinkDown)), "{driven:?}");
        }
    }

    fn react(&mut self) {
        for (at, event) in self.line.take_head_events() {
            match event {
                HostEvent::Report(_) => self.account.answers += 1,
                HostEvent::LinkDown => self.account.lost_nodes += 1,
                HostEvent::LinkUp if self.schedule.is_quiet() => {
                    self.account.recover(self.line.since_start(at), self.quiet_us);
                }
                _ => {}
            }
        }
    }

    /// A time in this plan, microseconds.
    pub(crate) fn slowed(&self, millis: u64) -> u64 {
        1000 * millis * u64::from(self.plan.slower)
    }

    /// Whether there has been no fault for this long.
    pub(crate) fn is_quiet_for(&self, micros: u64) -> bool {
        self.schedule.is_quiet() && self.line.elapsed() >= self.quiet_us + micros
    }

    /// Notes the frames and the periods of the robot in place.
    fn close_beats(&mut self) {
        let tail = self.line.tail_mut(0);
        let (periods, missed) = tail.beats.periods();
        let reports = tail.frames[REPORT];
        tail.beats = Beats::none();
        self.account.periods += periods;
        self.account.missed_periods += missed;
        self.account.reads += reports;
    }
}

fn head(plan: &Plan, now: Instant) -> Head {
    let times = |span: Duration| span.saturating_mul(plan.slower);
    let mut config = HostConfig::direct();
    config.command_period = times(config.command_period);
    config.dead_man = times(config.dead_man);
    config.ping_period = config.ping_period.map(times);
    config.ping_timeout = times(config.ping_timeout);
    config.link_timeout = times(config.link_timeout);
    Station::new(Host::new(config, now), Clock::Line, kind, Beats::none())
}

/// A robot that was switched on at `now`, whose processor counts its own time.
fn tail(plan: &Plan, now: Instant, rng: &mut Rng) -> Tail {
    let times = |span: Duration| span.saturating_mul(plan.slower);
    let mut config = RobotConfig::direct();
    config.watchdog = times(config.watchdog);
    config.report_period = times(config.report_period);
    config.bias_request_period = config.bias_request_period.map(times);
    let ahead = rng.next_u64() as u32;
    let own = Instant::from_micros(u64::from((now.as_micros() as u32).wrapping_add(ahead)));
    let period_us = u64::from(config.report_period.as_micros());
    let beats = Beats::new(period_us, |frame| (kind(frame) == REPORT).then_some(0));
    Station::new(RoverNode::new(config, own), Clock::wrapping(ahead), kind, beats)
}
