//! Master and slave in C and in Rust, for both boards.

use axlewire::{
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave, Status, Target,
        board::{Board, OneMotor, ThreeMotors},
        master::{
            Cause, CommandError, Health, MasterConfig, MasterEvent, NodeStatistics, Polling,
            StopProgress,
        },
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};
use axlewire_c::*;

use crate::twin::{Object, Pair, Twin, counters, latency, object, same, value};

/// The functions of a master.
pub(crate) trait MasterInC: Object {
    fn init(it: *mut Self, config: &axle_ikeya_master_config, now: u64) -> axle_result;
    fn event(it: *mut Self, event: *mut axle_ikeya_master_event) -> axle_result;
    fn discover(it: *mut Self, now: u64) -> axle_result;
    fn stop(it: *mut Self, node: u8, now: u64) -> axle_result;
    fn stop_all(it: *mut Self, now: u64) -> axle_result;
    fn check(it: *const Self, node: u8, motion: &axle_ikeya_motion) -> axle_result;
    fn read(it: *mut Self, node: u8, now: u64) -> axle_result;
    fn confirm(it: *mut Self, node: u8, now: u64) -> axle_result;
    fn keep_alive(it: *mut Self, now: u64) -> axle_result;
    fn release(it: *mut Self, node: u8) -> axle_result;
    fn node(it: *const Self, node: u8, known: *mut axle_ikeya_node) -> axle_result;
    fn bus(it: *const Self, known: *mut axle_ikeya_bus) -> axle_result;
    fn statistics(it: *const Self, counts: *mut axle_ikeya_master_statistics) -> axle_result;
    fn node_statistics(
        it: *const Self,
        node: u8,
        counts: *mut axle_ikeya_node_statistics,
    ) -> axle_result;
    fn counters(it: *const Self, account: *mut axle_counters) -> axle_result;
    fn velocity(it: *mut Self, node: u8, rps: [f32; 3], now: u64) -> axle_result;
    fn position(it: *mut Self, node: u8, to: [axle_ikeya_position; 3], now: u64) -> axle_result;
}

/// The functions of a slave.
pub(crate) trait SlaveInC: Object {
    fn init(
        it: *mut Self,
        node: u8,
        mode: u8,
        config: &axle_ikeya_slave_config,
        now: u64,
    ) -> axle_result;
    fn event(it: *mut Self, event: *mut axle_ikeya_slave_event) -> axle_result;
    fn command(it: *const Self, now: u64, command: *mut axle_ikeya_motion) -> axle_result;
    fn set_mode(it: *mut Self, mode: u8) -> axle_result;
    fn statistics(it: *const Self, counts: *mut axle_ikeya_slave_statistics) -> axle_result;
    fn counters(it: *const Self, account: *mut axle_counters) -> axle_result;
    fn velocity(it: *mut Self, rps: [f32; 3]) -> axle_result;
    fn position(it: *mut Self, at: [axle_ikeya_position; 3]) -> axle_result;
}

macro_rules! master {
    ($it:ident: $init:ident $event:ident $discover:ident $stop:ident $stop_all:ident $check:ident
        $read:ident $confirm:ident $keep_alive:ident $release:ident $node:ident $bus:ident $statistics:ident
        $node_statistics:ident $counters:ident, $velocity:expr, $position:expr) => {
        impl MasterInC for $it {
            fn init(it: *mut Self, config: &axle_ikeya_master_config, now: u64) -> axle_result {
                $init(it, size_of::<Self>(), config, now)
            }
            fn event(it: *mut Self, event: *mut axle_ikeya_master_event) -> axle_result {
                $event(it, event)
            }
            fn discover(it: *mut Self, now: u64) -> axle_result {
                $discover(it, now)
            }
            fn stop(it: *mut Self, node: u8, now: u64) -> axle_result {
                $stop(it, node, now)
            }
            fn stop_all(it: *mut Self, now: u64) -> axle_result {
                $stop_all(it, now)
            }
            fn check(it: *const Self, node: u8, motion: &axle_ikeya_motion) -> axle_result {
                $check(it, node, motion)
            }
            fn read(it: *mut Self, node: u8, now: u64) -> axle_result {
                $read(it, node, now)
            }
            fn confirm(it: *mut Self, node: u8, now: u64) -> axle_result {
                $confirm(it, node, now)
            }
            fn keep_alive(it: *mut Self, now: u64) -> axle_result {
                $keep_alive(it, now)
            }
            fn release(it: *mut Self, node: u8) -> axle_result {
                $release(it, node)
            }
            fn node(it: *const Self, node: u8, known: *mut axle_ikeya_node) -> axle_result {
                $node(it, node, known)
            }
            fn bus(it: *const Self, known: *mut axle_ikeya_bus) -> axle_result {
                $bus(it, known)
            }
            fn statistics(
                it: *const Self,
                counts: *mut axle_ikeya_master_statistics,
            ) -> axle_result {
                $statistics(it, counts)
            }
            fn node_statistics(
                it: *const Self,
                node: u8,
                counts: *mut axle_ikeya_node_statistics,
            ) -> axle_result {
                $node_statistics(it, node, counts)
            }
            fn counters(it: *const Self, account: *mut axle_counters) -> axle_result {
                $counters(it, account)
            }
            fn velocity(it: *mut Self, node: u8, rps: [f32; 3], now: u64) -> axle_result {
                $velocity(it, node, rps, now)
            }
            fn position(
                it: *mut Self,
                node: u8,
                to: [axle_ikeya_position; 3],
                now: u64,
            ) -> axle_result {
                $position(it, node, to, now)
            }
        }
    };
}

macro_rules! slave {
    ($it:ident: $init:ident $event:ident $command:ident $set_mode:ident $statistics:ident
        $counters:ident, $velocity:expr, $position:expr) => {
        impl SlaveInC for $it {
            fn init(
                it: *mut Self,
                node: u8,
                mode: u8,
                config: &axle_ikeya_slave_config,
                now: u64,
            ) -> axle_result {
                $init(it, size_of::<Self>(), node, mode, config, now)
            }
            fn event(it: *mut Self, event: *mut axle_ikeya_slave_event) -> axle_result {
                $event(it, event)
            }
            fn command(it: *const Self, now: u64, command: *mut axle_ikeya_motion) -> axle_result {
                $command(it, now, command)
            }
            fn set_mode(it: *mut Self, mode: u8) -> axle_result {
                $set_mode(it, mode)
            }
            fn statistics(
                it: *const Self,
                counts: *mut axle_ikeya_slave_statistics,
            ) -> axle_result {
                $statistics(it, counts)
            }
            fn counters(it: *const Self, account: *mut axle_counters) -> axle_result {
                $counters(it, account)
            }
            fn velocity(it: *mut Self, rps: [f32; 3]) -> axle_result {
                $velocity(it, rps)
            }
            fn position(it: *mut Self, at: [axle_ikeya_position; 3]) -> axle_result {
                $position(it, at)
            }
        }
    };
}

type Positions = [axle_ikeya_position; 3];

object!(axle_ikeya_master:
    axle_ikeya_master_handle_input axle_ikeya_master_handle_old_input
    axle_ikeya_master_handle_timeout axle_ikeya_master_poll_transmit
    axle_ikeya_master_handle_transmit axle_ikeya_master_is_outdated
    axle_ikeya_master_next_deadline axle_ikeya_master_get_line_rules);
object!(axle_ikeya3_master:
    axle_ikeya3_master_handle_input axle_ikeya3_master_handle_old_input
    axle_ikeya3_master_handle_timeout axle_ikeya3_master_poll_transmit
    axle_ikeya3_master_handle_transmit axle_ikeya3_master_is_outdated
    axle_ikeya3_master_next_deadline axle_ikeya3_master_get_line_rules);
object!(axle_ikeya_slave:
    axle_ikeya_slave_handle_input axle_ikeya_slave_handle_old_input
    axle_ikeya_slave_handle_timeout axle_ikeya_slave_poll_transmit
    axle_ikeya_slave_handle_transmit axle_ikeya_slave_is_outdated
    axle_ikeya_slave_next_deadline axle_ikeya_slave_get_line_rules);
object!(axle_ikeya3_slave:
    axle_ikeya3_slave_handle_input axle_ikeya3_slave_handle_old_input
    axle_ikeya3_slave_handle_timeout axle_ikeya3_slave_poll_transmit
    axle_ikeya3_slave_handle_transmit axle_ikeya3_slave_is_outdated
    axle_ikeya3_slave_next_deadline axle_ikeya3_slave_get_line_rules);
master!(axle_ikeya_master:
    axle_ikeya_master_init axle_ikeya_master_poll_event axle_ikeya_master_discover
    axle_ikeya_master_stop axle_ikeya_master_stop_all axle_ikeya_master_check axle_ikeya_master_read
    axle_ikeya_master_confirm axle_ikeya_master_keep_alive axle_ikeya_master_release
    axle_ikeya_master_get_node axle_ikeya_master_get_bus axle_ikeya_master_get_statistics
    axle_ikeya_master_get_node_statistics axle_ikeya_master_get_counters,
    |it, node, rps: [f32; 3], now| axle_ikeya_master_set_velocity(it, node, rps[0], now),
    |it, node, to: Positions, now| axle_ikeya_master_set_position(it, node, to[0], now));
master!(axle_ikeya3_master:
    axle_ikeya3_master_init axle_ikeya3_master_poll_event axle_ikeya3_master_discover
    axle_ikeya3_master_stop axle_ikeya3_master_stop_all axle_ikeya3_master_check
    axle_ikeya3_master_read
    axle_ikeya3_master_confirm axle_ikeya3_master_keep_alive axle_ikeya3_master_release
    axle_ikeya3_master_get_node axle_ikeya3_master_get_bus axle_ikeya3_master_get_statistics
    axle_ikeya3_master_get_node_statistics axle_ikeya3_master_get_counters,
    |it, node, rps: [f32; 3], now| axle_ikeya3_master_set_velocity(it, node, rps.as_ptr(), now),
    |it, node, to: Positions, now| axle_ikeya3_master_set_position(it, node, to.as_ptr(), now));
slave!(axle_ikeya_slave:
    axle_ikeya_slave_init axle_ikeya_slave_poll_event axle_ikeya_slave_get_command
    axle_ikeya_slave_set_mode axle_ikeya_slave_get_statistics axle_ikeya_slave_get_counters,
    |it, rps: [f32; 3]| axle_ikeya_slave_set_velocity(it, rps[0]),
    |it, at: Positions| axle_ikeya_slave_set_position(it, at[0]));
slave!(axle_ikeya3_slave:
    axle_ikeya3_slave_init axle_ikeya3_slave_poll_event axle_ikeya3_slave_get_command
    axle_ikeya3_slave_set_mode axle_ikeya3_slave_get_statistics axle_ikeya3_slave_get_counters,
    |it, rps: [f32; 3]| axle_ikeya3_slave_set_velocity(it, rps.as_ptr()),
    |it, at: Positions| axle_ikeya3_slave_set_position(it, at.as_ptr()));

/// A board with its objects, and its values as three.
pub(crate) trait Kind: Board {
    type Master: MasterInC;
    type Slave: SlaveInC;
    const MOTORS: usize;

    fn velocity(rps: [Rps; 3]) -> Self::Velocity;
    fn rps(velocity: Self::Velocity) -> [f32; 3];
    fn raw(velocity: Self::RawVelocity) -> [f32; 3];
    fn position(to: [Position; 3]) -> Self::Position;
    fn positions(position: Self::Position) -> Vec<Position>;
}

impl Kind for OneMotor {
    type Master = axle_ikeya_master;
    type Slave = axle_ikeya_slave;
    const MOTORS: usize = 1;

    fn velocity(rps: [Rps; 3]) -> Rps {
        rps[0]
    }
    fn rps(velocity: Rps) -> [f32; 3] {
        [velocity.get(), 0.0, 0.0]
    }
    fn raw(velocity: f32) -> [f32; 3] {
        [velocity, 0.0, 0.0]
    }
    fn position(to: [Position; 3]) -> Position {
        to[0]
    }
    fn positions(position: Position) -> Vec<Position> {
        vec![position]
    }
}

impl Kind for ThreeMotors {
    type Master = axle_ikeya3_master;
    type Slave = axle_ikeya3_slave;
    const MOTORS: usize = 3;

    fn velocity(rps: [Rps; 3]) -> [Rps; 3] {
        rps
    }
    fn rps(velocity: [Rps; 3]) -> [f32; 3] {
        velocity.map(Rps::get)
    }
    fn raw(velocity: [f32; 3]) -> [f32; 3] {
        velocity
    }
    fn position(to: [Position; 3]) -> [Position; 3] {
        to
    }
    fn positions(position: [Position; 3]) -> Vec<Position> {
        position.to_vec()
    }
}

pub(crate) fn position_in_c(of: Position) -> axle_ikeya_position {
    axle_ikeya_position { rotation: of.rotation(), count: of.count() }
}

fn positions_in_c<B: Kind>(of: B::Position) -> [axle_ikeya_position; 3] {
    let mut positions = [axle_ikeya_position::default(); 3];
    let known = B::positions(of).into_iter().zip(&mut positions);
    known.for_each(|(of, to)| *to = position_in_c(of));
    positions
}

fn motion(mode: u8, velocity_rps: [f32; 3], position: Positions) -> axle_ikeya_motion {
    axle_ikeya_motion { mode, velocity_rps, position }
}

fn status<B: Kind>(of: Status<B>) -> axle_ikeya_motion {
    match of {
        Status::Velocity(velocity) => motion(1, B::raw(velocity), Default::default()),
        Status::Position(position) => motion(2, [0.0; 3], positions_in_c::<B>(position)),
    }
}

fn target<B: Kind>(of: Target<B>) -> axle_ikeya_motion {
    match of {
        Target::Velocity(velocity) => motion(1, B::rps(velocity), Default::default()),
        Target::Position(position) => motion(2, [0.0; 3], positions_in_c::<B>(position)),
    }
}

pub(crate) fn mode_in_c(mode: Mode) -> u8 {
    match mode {
        Mode::Velocity => 1,
        Mode::Position => 2,
    }
}

fn health(of: Option<Health>) -> (u8, u8) {
    match of {
        None => (0, 0),
        Some(Health::Online) => (1, 0),
        Some(Health::Suspect(missed)) => (2, missed),
        Some(Health::Abnormal) => (3, 0),
    }
}

fn cause(of: Cause) -> u8 {
    match of {
        Cause::Silent => 1,
        Cause::Damaged => 2,
        Cause::Unexpected => 3,
        Cause::Dropped => 4,
        other => panic!("{other:?}"),
    }
}

fn stop(of: StopProgress) -> u8 {
    match of {
        StopProgress::NotAsked => 0,
        StopProgress::Owed => 1,
        StopProgress::Confirmed => 2,
        StopProgress::StandingStill => 3,
        StopProgress::StillMoving => 4,
    }
}

pub(crate) fn command_error(of: Result<(), CommandError>) -> axle_result {
    match of {
        Ok(()) => 0,
        Err(CommandError::NotOnline { .. }) => -60,
        Err(CommandError::WrongMode { .. }) => -61,
        Err(CommandError::ModeInDoubt { .. }) => -62,
        Err(CommandError::StopOwed { .. }) => -63,
        Err(CommandError::NoSetPoint { .. }) => -64,
        Err(other) => panic!("{other:?}"),
    }
}

fn us(span: Option<Duration>) -> u32 {
    span.map_or(0, Duration::as_micros)
}

pub(crate) fn master_config(of: &MasterConfig) -> axle_ikeya_master_config {
    let (polling, period) = match of.polling {
        Polling::Fastest => (1, 0),
        Polling::Every(period) => (2, period.as_micros()),
        Polling::Manual => (3, 0),
    };
    axle_ikeya_master_config {
        baud: of.baud,
        reply_timeout_us: of.reply_timeout.as_micros(),
        late_guard_us: of.late_guard.as_micros(),
        turnaround_gap_us: of.turnaround_gap.as_micros(),
        polling_period_us: period,
        hold_age_us: of.hold_age.as_micros(),
        coast_us: of.coast.as_micros(),
        dead_man_us: us(of.dead_man),
        nodes: of.nodes.iter().map(|node| 1 << (node.get() - 1)).sum(),
        polling,
        attempts: of.attempts,
        recovery_share_pct: of.recovery_share_pct,
        accepts_early: of.accepts_early.into(),
        stops_abnormal: of.stops_abnormal.into(),
    }
}

pub(crate) fn slave_config(of: &SlaveConfig) -> axle_ikeya_slave_config {
    axle_ikeya_slave_config {
        baud: of.baud,
        watchdog_us: us(of.watchdog),
        turnaround_gap_us: of.turnaround_gap.as_micros(),
        idle_us: of.idle.as_micros(),
        answer_within_us: of.answer_within.as_micros(),
        two_wire: of.two_wire.into(),
    }
}

fn node_of<B: Kind>(master: &Master<B>, node: NodeId) -> axle_ikeya_node {
    let (health, failures) = health(master.health(node));
    let measured = master.status(node);
    let read = master.read_outcome(node);
    axle_ikeya_node {
        measured_at_us: measured.map_or(0, |(_, at)| at.as_micros()),
        status: measured.map_or(axle_ikeya_motion::default(), |(it, _)| status(it)),
        set_point: master.set_point(node).map_or(axle_ikeya_motion::default(), target),
        mode: master.mode(node).map_or(0, mode_in_c),
        health,
        failures,
        stop: stop(master.stop_progress(node)),
        is_set_point_sent: master.is_set_point_sent(node).into(),
        is_mode_in_doubt: master.is_mode_in_doubt(node).into(),
        last_failure: master.last_failure(node).map_or(0, cause),
        is_read_over: read.is_some().into(),
        read_failure: read.map_or(0, |read| read.err().map_or(0, cause)),
    }
}

fn node_statistics(of: &NodeStatistics) -> axle_ikeya_node_statistics {
    axle_ikeya_node_statistics {
        requests: of.requests,
        replies: of.replies,
        timeouts: of.timeouts,
        crc_errors: of.crc_errors,
        early: of.early,
        late: of.late,
        other_mode: of.other_mode,
        retries: of.retries,
        failures: of.failures,
        latency: latency(of.latency),
    }
}

impl<B: Kind> Pair for Master<B> {
    type Object = B::Master;
    type Told = axle_ikeya_master_event;

    fn poll_in_c(object: *mut B::Master, event: *mut axle_ikeya_master_event) -> axle_result {
        B::Master::event(object, event)
    }

    fn expected(event: &MasterEvent<B>) -> axle_ikeya_master_event {
        let mut told = axle_ikeya_master_event::default();
        let (kind, node) = match *event {
            MasterEvent::Discovered { node, mode } => {
                told.mode = mode_in_c(mode);
                (1, Some(node))
            }
            MasterEvent::DiscoveryDone { online } => {
                told.online = online;
                (2, None)
            }
            MasterEvent::Status { node, status: of } => {
                told.motion = status(of);
                (3, Some(node))
            }
            MasterEvent::Health { node, health: of } => {
                (told.health, told.failures) = health(Some(of));
                (4, Some(node))
            }
            MasterEvent::ReadFailed { node, cause: of } => {
                told.cause = cause(of);
                (5, Some(node))
            }
            MasterEvent::ModeChanged { node, mode } => {
                told.mode = mode_in_c(mode);
                (6, Some(node))
            }
            MasterEvent::ModeInDoubt { node } => (7, Some(node)),
            MasterEvent::Confirmed { node } => (8, Some(node)),
            MasterEvent::NotConfirmed { node, cause: of } => {
                told.cause = cause(of);
                (9, Some(node))
            }
            MasterEvent::Stopped { node } => (10, Some(node)),
            MasterEvent::StandingStill { node } => (11, Some(node)),
            MasterEvent::StillMoving { node, status: of } => {
                told.motion = status(of);
                (12, Some(node))
            }
            MasterEvent::StopBlocked { node } => (13, Some(node)),
            MasterEvent::DeadMan => (14, None),
            ref other => panic!("{other:?}"),
        };
        (told.kind, told.node) = (kind, node.map_or(0, NodeId::get));
        told
    }

    fn same(&self, object: *mut B::Master, _: Instant) {
        for node in NodeId::ALL {
            let id = node.get();
            same(value(|to| B::Master::node(object, id, to)), Some(node_of(self, node)));
            let counts = value(|to| B::Master::node_statistics(object, id, to));
            same(counts, Some(node_statistics(self.node_statistics(node))));
        }
        let set = |nodes: axlewire::ikeya::master::NodeSet| {
            nodes.iter().map(|node| 1 << (node.get() - 1)).sum()
        };
        let bus = axle_ikeya_bus {
            lost_events: self.lost_events(),
            stop_bound_us: self.stop_bound().as_micros(),
            read_bound_us: self.read_bound().as_micros(),
            stops_owed: set(self.stops_owed()),
            coasting: set(self.coasting()),
            is_discovering: self.is_discovering().into(),
        };
        same(value(|to| B::Master::bus(object, to)), Some(bus));
        let of = self.statistics();
        let counts = axle_ikeya_master_statistics {
            reads: of.reads,
            writes: of.writes,
            stale_bytes: of.stale_bytes,
            dead_man: of.dead_man,
        };
        same(value(|to| B::Master::statistics(object, to)), Some(counts));
        let account = value(|to| B::Master::counters(object, to));
        same(account, Some(counters(self.counters())));
    }
}

impl<B: Kind> Pair for Slave<B> {
    type Object = B::Slave;
    type Told = axle_ikeya_slave_event;

    fn poll_in_c(object: *mut B::Slave, event: *mut axle_ikeya_slave_event) -> axle_result {
        B::Slave::event(object, event)
    }

    fn expected(event: &SlaveEvent<B>) -> axle_ikeya_slave_event {
        match *event {
            SlaveEvent::Command(to) => axle_ikeya_slave_event { kind: 1, motion: target(to) },
            SlaveEvent::Watchdog => {
                axle_ikeya_slave_event { kind: 2, motion: axle_ikeya_motion::default() }
            }
            ref other => panic!("{other:?}"),
        }
    }

    fn same(&self, object: *mut B::Slave, now: Instant) {
        let command = value(|to| B::Slave::command(object, now.as_micros(), to));
        same(command, self.command(now).map(target));
        let of = self.statistics();
        let counts = axle_ikeya_slave_statistics {
            reads: of.reads,
            writes: of.writes,
            refused: of.refused,
            foreign: of.foreign,
            answers: of.answers,
            replies: of.replies,
            overtaken: of.overtaken,
            expired: of.expired,
            watchdog: of.watchdog,
            lost_events: self.lost_events(),
        };
        same(value(|to| B::Slave::statistics(object, to)), Some(counts));
        let account = value(|to| B::Slave::counters(object, to));
        same(account, Some(counters(self.counters())));
    }
}

/// The commands of a master.
impl<B: Kind> Twin<Master<B>> {
    pub(crate) fn master(config: MasterConfig, now: Instant) -> Self {
        let in_c = master_config(&config);
        let rust = Master::for_board(config, now);
        Self::new(rust, now, |it| B::Master::init(it, &in_c, now.as_micros()))
    }

    #[track_caller]
    pub(crate) fn discover(&mut self, now: Instant) {
        self.both(
            |it| B::Master::discover(it, now.as_micros()),
            |master| {
                master.discover(now);
                0
            },
        );
    }

    #[track_caller]
    pub(crate) fn stop(&mut self, node: NodeId, now: Instant) {
        self.both(
            |it| B::Master::stop(it, node.get(), now.as_micros()),
            |master| {
                master.stop(node, now);
                0
            },
        );
    }

    #[track_caller]
    pub(crate) fn stop_all(&mut self, now: Instant) {
        self.both(
            |it| B::Master::stop_all(it, now.as_micros()),
            |master| {
                master.stop_all(now);
                0
            },
        );
    }

    #[track_caller]
    pub(crate) fn keep_alive(&mut self, now: Instant) {
        self.both(
            |it| B::Master::keep_alive(it, now.as_micros()),
            |master| {
                master.keep_alive(now);
                0
            },
        );
    }

    #[track_caller]
    pub(crate) fn release(&mut self, node: NodeId) {
        self.both(
            |it| B::Master::release(it, node.get()),
            |master| {
                master.release(node);
                0
            },
        );
    }

    #[track_caller]
    pub(crate) fn read(&mut self, node: NodeId, now: Instant) -> axle_result {
        self.both(
            |it| B::Master::read(it, node.get(), now.as_micros()),
            |master| command_error(master.read(node, now)),
        )
    }

    #[track_caller]
    pub(crate) fn confirm(&mut self, node: NodeId, now: Instant) -> axle_result {
        self.both(
            |it| B::Master::confirm(it, node.get(), now.as_micros()),
            |master| command_error(master.confirm(node, now)),
        )
    }

    /// The second and third motor turn half as fast and backwards.
    #[track_caller]
    pub(crate) fn turn(&mut self, node: NodeId, rps: f32, now: Instant) -> axle_result {
        let speeds = [rps, rps / 2.0, -rps];
        let checked = self.check_motion(
            node,
            axle_ikeya_motion {
                mode: AXLE_IKEYA_MODE_VELOCITY,
                velocity_rps: speeds,
                ..Default::default()
            },
        );
        let done = self.both(
            |it| B::Master::velocity(it, node.get(), speeds, now.as_micros()),
            |master| match speeds.map(Rps::new) {
                [Ok(a), Ok(b), Ok(c)] => {
                    command_error(master.set_velocity(node, B::velocity([a, b, c]), now))
                }
                _ => -22,
            },
        );
        assert_eq!(checked, done);
        done
    }

    fn check_motion(&self, node: NodeId, motion: axle_ikeya_motion) -> axle_result {
        B::Master::check(self.c(), node.get(), &motion)
    }

    /// The second and third motor go half as far and backwards.
    #[track_caller]
    pub(crate) fn go_to(&mut self, node: NodeId, counts: i32, now: Instant) -> axle_result {
        let to = [counts, counts / 2, -counts].map(|counts| Position::from_counts(counts).unwrap());
        let checked = self.check_motion(
            node,
            axle_ikeya_motion {
                mode: AXLE_IKEYA_MODE_POSITION,
                position: to.map(position_in_c),
                ..Default::default()
            },
        );
        let done = self.both(
            |it| B::Master::position(it, node.get(), to.map(position_in_c), now.as_micros()),
            |master| command_error(master.set_position(node, B::position(to), now)),
        );
        assert_eq!(checked, done);
        done
    }
}

/// The commands of a slave.
impl<B: Kind> Twin<Slave<B>> {
    pub(crate) fn slave(node: NodeId, mode: Mode, config: SlaveConfig, now: Instant) -> Self {
        let in_c = slave_config(&config);
        let rust = Slave::for_board(node, mode, config, now);
        let mode = mode_in_c(mode);
        Self::new(rust, now, |it| B::Slave::init(it, node.get(), mode, &in_c, now.as_micros()))
    }

    pub(crate) fn set_mode(&mut self, mode: Mode) {
        self.both(
            |it| B::Slave::set_mode(it, mode_in_c(mode)),
            |slave| {
                slave.set_mode(mode);
                0
            },
        );
    }

    /// Tells the slave how its motors turn, and where they are.
    pub(crate) fn measure(&mut self, rps: [Rps; 3], at: [Position; 3]) {
        assert_eq!(B::Slave::velocity(self.c(), rps.map(Rps::get)), 0);
        assert_eq!(B::Slave::position(self.c(), at.map(position_in_c)), 0);
        let slave = self.rust_mut();
        slave.set_velocity(B::velocity(rps));
        slave.set_position(B::position(at));
    }
}
