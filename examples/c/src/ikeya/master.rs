//! The master of a motor bus.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Master, NodeId,
        board::{OneMotor, Target, ThreeMotors},
        master::{
            Cause, Health, MasterConfig, MasterEvent, MasterStatistics, NodeSet, NodeStatistics,
            Polling, StopProgress,
        },
    },
    stats::Latency,
};

use super::{
    AXLE_IKEYA_MODE_POSITION, AXLE_IKEYA_MODE_VELOCITY, Motors, axle_ikeya_mode, axle_ikeya_motion,
    axle_ikeya_position, mode_of, node_from,
};
use crate::{
    memory::{Memory, Out, enter, get, init, read},
    result::{AXLE_ERROR_VALUE, axle_result, of, of_encode, of_master},
    stream::axle_counters,
    time::{at, micros, optional, span},
};

/// Ids as bits: bit 0 is node 1, bit 7 is node 8.
pub type axle_ikeya_node_set = u8;

/// Settings of a master. Begin with those of `axle_ikeya_master_config_direct` or `_usb_adapter`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_ikeya_master_config {
    /// Speed of the line, bit/s; 0 counts as 500,000. Not less than it really is.
    pub baud: u32,
    /// Longest time from the end of a request on the wire to the start of its answer (ruling I7).
    pub reply_timeout_us: u32,
    /// Time after a missed answer during which the node is not polled again. An answer that is
    /// later than both is taken for the next one: a motor that turns may then be told to stand
    /// still, from a measurement of before. Set `reply_timeout_us` for the slowest answer of
    /// your line.
    pub late_guard_us: u32,
    /// Silence between a request or an answer and the next request, for transceivers that need it;
    /// 0 by default.
    pub turnaround_gap_us: u32,
    /// Period in which each node is read, for `AXLE_IKEYA_POLLING_EVERY`; with 0, as fast as the
    /// line allows.
    pub polling_period_us: u32,
    /// Age of a measured position that a stop may hold; 0, the default: always read (ruling I6).
    pub hold_age_us: u32,
    /// Time in which a motor may come to rest after its stop is confirmed (ruling I12); 2 s.
    pub coast_us: u32,
    /// Time without a command or `keep_alive` after which every node under a set-point is owed a
    /// stop (ruling I13); 0, the default, for none.
    pub dead_man_us: u32,
    /// Ids on this bus; all eight by default.
    pub nodes: axle_ikeya_node_set,
    /// One of `AXLE_IKEYA_POLLING_`; `AXLE_IKEYA_POLLING_FASTEST` by default.
    pub polling: u8,
    /// Attempts of a READ before it has failed (ruling I8); 3 by default, 0 counts as 1.
    pub attempts: u8,
    /// Share of line time for finding abnormal nodes, percent; 5 by default, more than 50 counts
    /// as 50 (I13).
    pub recovery_share_pct: u8,
    /// Not 0 if an answer may arrive before the line could have carried it, as behind a pipe, or
    /// if the clock is coarser than 20 us.
    pub accepts_early: u8,
    /// Not 0 if a node that becomes abnormal while under a set-point is owed a stop (I12); 1.
    pub stops_abnormal: u8,
}
plain!(axle_ikeya_master_config);

/// Nodes are read one after another, as fast as the line allows.
pub const AXLE_IKEYA_POLLING_FASTEST: u8 = 1;
/// Each node is read once per period, and its set-point repeated at the same rate.
pub const AXLE_IKEYA_POLLING_EVERY: u8 = 2;
/// Nodes are read on request only, and to stop them.
pub const AXLE_IKEYA_POLLING_MANUAL: u8 = 3;

impl From<MasterConfig> for axle_ikeya_master_config {
    fn from(config: MasterConfig) -> Self {
        let (polling, period) = match config.polling {
            Polling::Fastest => (AXLE_IKEYA_POLLING_FASTEST, None),
            Polling::Every(period) => (AXLE_IKEYA_POLLING_EVERY, Some(period)),
            Polling::Manual => (AXLE_IKEYA_POLLING_MANUAL, None),
        };
        Self {
            baud: config.baud,
            reply_timeout_us: config.reply_timeout.as_micros(),
            late_guard_us: config.late_guard.as_micros(),
            turnaround_gap_us: config.turnaround_gap.as_micros(),
            polling_period_us: micros(period),
            hold_age_us: config.hold_age.as_micros(),
            coast_us: config.coast.as_micros(),
            dead_man_us: micros(config.dead_man),
            nodes: bits(config.nodes),
            polling,
            attempts: config.attempts,
            recovery_share_pct: config.recovery_share_pct,
            accepts_early: config.accepts_early.into(),
            stops_abnormal: config.stops_abnormal.into(),
        }
    }
}

impl TryFrom<axle_ikeya_master_config> for MasterConfig {
    type Error = axle_result;

    fn try_from(from: axle_ikeya_master_config) -> Result<Self, axle_result> {
        let mut config = Self::direct();
        config.baud = from.baud;
        config.reply_timeout = span(from.reply_timeout_us);
        config.late_guard = span(from.late_guard_us);
        config.turnaround_gap = span(from.turnaround_gap_us);
        config.polling = match from.polling {
            AXLE_IKEYA_POLLING_FASTEST => Polling::Fastest,
            AXLE_IKEYA_POLLING_EVERY => Polling::Every(span(from.polling_period_us)),
            AXLE_IKEYA_POLLING_MANUAL => Polling::Manual,
            _ => return Err(AXLE_ERROR_VALUE),
        };
        config.hold_age = span(from.hold_age_us);
        config.coast = span(from.coast_us);
        config.dead_man = optional(from.dead_man_us);
        config.nodes =
            NodeId::ALL.into_iter().filter(|node| from.nodes & bit(*node) != 0).collect();
        config.attempts = from.attempts;
        config.recovery_share_pct = from.recovery_share_pct;
        config.accepts_early = from.accepts_early != 0;
        config.stops_abnormal = from.stops_abnormal != 0;
        Ok(config)
    }
}

const fn bit(node: NodeId) -> u8 {
    1 << (node.get() - 1)
}

fn bits(nodes: NodeSet) -> axle_ikeya_node_set {
    nodes.iter().fold(0, |bits, node| bits | bit(node))
}

/// An event of a master. What an event has is said with its kind; all else is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct axle_ikeya_master_event {
    /// One of `AXLE_IKEYA_MASTER_`.
    pub kind: u8,
    /// Id of the node, 1 to 8; 0 if the event is of no node.
    pub node: u8,
    /// One of `AXLE_IKEYA_MODE_`.
    pub mode: axle_ikeya_mode,
    /// One of `AXLE_IKEYA_HEALTH_`.
    pub health: u8,
    /// Answers missed in a row, with `AXLE_IKEYA_HEALTH_SUSPECT`.
    pub failures: u8,
    /// One of `AXLE_IKEYA_CAUSE_`.
    pub cause: u8,
    /// Number of nodes that are online.
    pub online: u8,
    /// What was measured.
    pub motion: axle_ikeya_motion,
}

kinds! {
    /// The name of a kind of event, such as "standing_still"; "?" for another number.
    axle_ikeya_master_event_name: u8;
    /// A node answered for the first time: `node`, `mode`.
    AXLE_IKEYA_MASTER_DISCOVERED = 1, c"discovered";
    /// All ids have been asked: `online`.
    AXLE_IKEYA_MASTER_DISCOVERY_DONE = 2, c"discovery_done";
    /// An answer: `node`, `motion`.
    AXLE_IKEYA_MASTER_STATUS = 3, c"status";
    /// The health of a node changed: `node`, `health`, `failures`.
    AXLE_IKEYA_MASTER_HEALTH = 4, c"health";
    /// A READ failed after its last attempt: `node`, `cause`.
    AXLE_IKEYA_MASTER_READ_FAILED = 5, c"read_failed";
    /// A node changed its mode, which ends its set-point: `node`, `mode` (ruling I11).
    AXLE_IKEYA_MASTER_MODE_CHANGED = 6, c"mode_changed";
    /// The mode of a node is still in doubt after six exchanges: `node` (ruling I11).
    AXLE_IKEYA_MASTER_MODE_IN_DOUBT = 7, c"mode_in_doubt";
    /// The set-point that was to be confirmed has arrived: `node`.
    AXLE_IKEYA_MASTER_CONFIRMED = 8, c"confirmed";
    /// It is not known whether it has: `node`, `cause`.
    AXLE_IKEYA_MASTER_NOT_CONFIRMED = 9, c"not_confirmed";
    /// A stop is confirmed; the motor may still turn: `node` (ruling I12).
    AXLE_IKEYA_MASTER_STOPPED = 10, c"stopped";
    /// A motor that was stopped is seen to be at rest: `node` (ruling I12).
    AXLE_IKEYA_MASTER_STANDING_STILL = 11, c"standing_still";
    /// A motor still moves after its time to coast: `node`, `motion` (ruling I12).
    AXLE_IKEYA_MASTER_STILL_MOVING = 12, c"still_moving";
    /// The mode of a node that is owed a stop is still in doubt, so the stop is not written: `node`
    /// (rulings I11, I12).
    AXLE_IKEYA_MASTER_STOP_BLOCKED = 13, c"stop_blocked";
    /// The dead-man has fired (ruling I13).
    AXLE_IKEYA_MASTER_DEAD_MAN = 14, c"dead_man";
    /// An event that is newer than this header.
    AXLE_IKEYA_MASTER_OTHER = 255, c"other";
}

kinds! {
    /// The name of a health, such as "online"; "?" for another number.
    axle_ikeya_health_name: u8;
    /// Never heard, or not a node of this bus.
    AXLE_IKEYA_HEALTH_UNKNOWN = 0, c"unknown";
    /// The node answers.
    AXLE_IKEYA_HEALTH_ONLINE = 1, c"online";
    /// The node has missed some answers.
    AXLE_IKEYA_HEALTH_SUSPECT = 2, c"suspect";
    /// The node no longer answers (ruling I7).
    AXLE_IKEYA_HEALTH_ABNORMAL = 3, c"abnormal";
}

kinds! {
    /// The name of a cause, such as "silent"; "?" for another number.
    axle_ikeya_cause_name: u8;
    /// No answer.
    AXLE_IKEYA_CAUSE_SILENT = 1, c"silent";
    /// A damaged answer.
    AXLE_IKEYA_CAUSE_DAMAGED = 2, c"damaged";
    /// Another node, another mode, too early or too late.
    AXLE_IKEYA_CAUSE_UNEXPECTED = 3, c"unexpected";
    /// The set-point to be confirmed was dropped.
    AXLE_IKEYA_CAUSE_DROPPED = 4, c"dropped";
    /// A cause that is newer than this header.
    AXLE_IKEYA_CAUSE_OTHER = 255, c"other";
}

kinds! {
    /// The name of what became of a stop, such as "owed"; "?" for another number.
    axle_ikeya_stop_name: u8;
    /// No stop was asked for.
    AXLE_IKEYA_STOP_NOT_ASKED = 0, c"not_asked";
    /// The stop is owed: not confirmed yet.
    AXLE_IKEYA_STOP_OWED = 1, c"owed";
    /// The stop is confirmed; the motor may still turn.
    AXLE_IKEYA_STOP_CONFIRMED = 2, c"confirmed";
    /// The motor is seen to be at rest.
    AXLE_IKEYA_STOP_STANDING_STILL = 3, c"standing_still";
    /// The motor still moves after its time to coast.
    AXLE_IKEYA_STOP_STILL_MOVING = 4, c"still_moving";
}

const fn cause_of(cause: Cause) -> u8 {
    match cause {
        Cause::Silent => AXLE_IKEYA_CAUSE_SILENT,
        Cause::Damaged => AXLE_IKEYA_CAUSE_DAMAGED,
        Cause::Unexpected => AXLE_IKEYA_CAUSE_UNEXPECTED,
        Cause::Dropped => AXLE_IKEYA_CAUSE_DROPPED,
        _ => AXLE_IKEYA_CAUSE_OTHER,
    }
}

const fn health_of(health: Option<Health>) -> (u8, u8) {
    match health {
        None => (AXLE_IKEYA_HEALTH_UNKNOWN, 0),
        Some(Health::Online) => (AXLE_IKEYA_HEALTH_ONLINE, 0),
        Some(Health::Suspect(failures)) => (AXLE_IKEYA_HEALTH_SUSPECT, failures),
        Some(Health::Abnormal) => (AXLE_IKEYA_HEALTH_ABNORMAL, 0),
    }
}

const fn stop_of(progress: StopProgress) -> u8 {
    match progress {
        StopProgress::NotAsked => AXLE_IKEYA_STOP_NOT_ASKED,
        StopProgress::Owed => AXLE_IKEYA_STOP_OWED,
        StopProgress::Confirmed => AXLE_IKEYA_STOP_CONFIRMED,
        StopProgress::StandingStill => AXLE_IKEYA_STOP_STANDING_STILL,
        StopProgress::StillMoving => AXLE_IKEYA_STOP_STILL_MOVING,
    }
}

impl<B: Motors> From<MasterEvent<B>> for axle_ikeya_master_event {
    fn from(event: MasterEvent<B>) -> Self {
        let of = |kind, node: NodeId| Self { kind, node: node.get(), ..Self::default() };
        match event {
            MasterEvent::Discovered { node, mode } => {
                Self { mode: mode_of(mode), ..of(AXLE_IKEYA_MASTER_DISCOVERED, node) }
            }
            MasterEvent::DiscoveryDone { online } => {
                Self { kind: AXLE_IKEYA_MASTER_DISCOVERY_DONE, online, ..Self::default() }
            }
            MasterEvent::Status { node, status } => {
                let motion = axle_ikeya_motion::of_status(status);
                Self { motion, ..of(AXLE_IKEYA_MASTER_STATUS, node) }
            }
            MasterEvent::Health { node, health } => {
                let (health, failures) = health_of(Some(health));
                Self { health, failures, ..of(AXLE_IKEYA_MASTER_HEALTH, node) }
            }
            MasterEvent::ReadFailed { node, cause } => {
                Self { cause: cause_of(cause), ..of(AXLE_IKEYA_MASTER_READ_FAILED, node) }
            }
            MasterEvent::ModeChanged { node, mode } => {
                Self { mode: mode_of(mode), ..of(AXLE_IKEYA_MASTER_MODE_CHANGED, node) }
            }
            MasterEvent::ModeInDoubt { node } => of(AXLE_IKEYA_MASTER_MODE_IN_DOUBT, node),
            MasterEvent::Confirmed { node } => of(AXLE_IKEYA_MASTER_CONFIRMED, node),
            MasterEvent::NotConfirmed { node, cause } => {
                Self { cause: cause_of(cause), ..of(AXLE_IKEYA_MASTER_NOT_CONFIRMED, node) }
            }
            MasterEvent::Stopped { node } => of(AXLE_IKEYA_MASTER_STOPPED, node),
            MasterEvent::StandingStill { node } => of(AXLE_IKEYA_MASTER_STANDING_STILL, node),
            MasterEvent::StillMoving { node, status } => {
                let motion = axle_ikeya_motion::of_status(status);
                Self { motion, ..of(AXLE_IKEYA_MASTER_STILL_MOVING, node) }
            }
            MasterEvent::StopBlocked { node } => of(AXLE_IKEYA_MASTER_STOP_BLOCKED, node),
            MasterEvent::DeadMan => Self { kind: AXLE_IKEYA_MASTER_DEAD_MAN, ..Self::default() },
            _ => Self { kind: AXLE_IKEYA_MASTER_OTHER, ..Self::default() },
        }
    }
}

/// What a master knows of a node.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct axle_ikeya_node {
    /// When `status` arrived, microseconds.
    pub measured_at_us: u64,
    /// The latest measurement; its mode is 0 if there is none.
    pub status: axle_ikeya_motion,
    /// The set-point in force; its mode is 0 if there is none.
    pub set_point: axle_ikeya_motion,
    /// The mode of the node, one of `AXLE_IKEYA_MODE_`; 0 if it is not known.
    pub mode: axle_ikeya_mode,
    /// One of `AXLE_IKEYA_HEALTH_`.
    pub health: u8,
    /// Answers missed in a row, with `AXLE_IKEYA_HEALTH_SUSPECT`.
    pub failures: u8,
    /// How far a stop has come: one of `AXLE_IKEYA_STOP_`.
    pub stop: u8,
    /// 1 if the latest set-point has left.
    pub is_set_point_sent: u8,
    /// 1 if the mode is in doubt (ruling I11).
    pub is_mode_in_doubt: u8,
    /// Why the latest READ that failed did so: one of `AXLE_IKEYA_CAUSE_`; 0 if none has.
    pub last_failure: u8,
    /// 1 if the latest requested READ has been answered or has failed.
    pub is_read_over: u8,
    /// Why the latest requested READ has failed: one of `AXLE_IKEYA_CAUSE_`; 0 if it has not.
    pub read_failure: u8,
}

fn node_of<B: Motors>(master: &Master<B>, node: NodeId) -> axle_ikeya_node {
    let (health, failures) = health_of(master.health(node));
    let (status, measured_at_us) = match master.status(node) {
        Some((status, at)) => (axle_ikeya_motion::of_status(status), at.as_micros()),
        None => Default::default(),
    };
    let read = master.read_outcome(node);
    axle_ikeya_node {
        measured_at_us,
        status,
        set_point: master.set_point(node).map(axle_ikeya_motion::of_target).unwrap_or_default(),
        mode: master.mode(node).map_or(0, mode_of),
        health,
        failures,
        stop: stop_of(master.stop_progress(node)),
        is_set_point_sent: master.is_set_point_sent(node).into(),
        is_mode_in_doubt: master.is_mode_in_doubt(node).into(),
        last_failure: master.last_failure(node).map_or(0, cause_of),
        is_read_over: read.is_some().into(),
        read_failure: read.and_then(Result::err).map_or(0, cause_of),
    }
}

/// What a master knows of its bus.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_bus {
    /// Events that were refused because the queue was full.
    pub lost_events: u32,
    /// Time within which a stop is confirmed, or its node is abnormal, microseconds.
    pub stop_bound_us: u32,
    /// Time within which a requested READ is answered or has failed, microseconds.
    pub read_bound_us: u32,
    /// Nodes that are owed a stop (ruling I12).
    pub stops_owed: axle_ikeya_node_set,
    /// Nodes whose stop is confirmed, and which are not yet seen to be at rest.
    pub coasting: axle_ikeya_node_set,
    /// 1 while all ids are being asked.
    pub is_discovering: u8,
}

fn bus_of<B: Motors>(master: &Master<B>) -> axle_ikeya_bus {
    axle_ikeya_bus {
        lost_events: master.lost_events(),
        stop_bound_us: master.stop_bound().as_micros(),
        read_bound_us: master.read_bound().as_micros(),
        stops_owed: bits(master.stops_owed()),
        coasting: bits(master.coasting()),
        is_discovering: master.is_discovering().into(),
    }
}

/// Times, microseconds; all 0 if there is none yet.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_latency {
    /// How many there are.
    pub count: u32,
    /// The latest.
    pub last_us: u32,
    /// The shortest.
    pub min_us: u32,
    /// The longest.
    pub max_us: u32,
    /// Their mean.
    pub mean_us: u32,
}

impl From<Latency> for axle_latency {
    fn from(latency: Latency) -> Self {
        Self {
            count: latency.count(),
            last_us: micros(latency.last()),
            min_us: micros(latency.min()),
            max_us: micros(latency.max()),
            mean_us: micros(latency.mean()),
        }
    }
}

/// Counts of a master.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_master_statistics {
    /// READs sent.
    pub reads: u32,
    /// WRITEs sent.
    pub writes: u32,
    /// Bytes dropped because they came before a request.
    pub stale_bytes: u32,
    /// How often the dead-man has fired.
    pub dead_man: u32,
}

impl From<MasterStatistics> for axle_ikeya_master_statistics {
    fn from(of: MasterStatistics) -> Self {
        let MasterStatistics { reads, writes, stale_bytes, dead_man, .. } = of;
        Self { reads, writes, stale_bytes, dead_man }
    }
}

/// Counts of one node.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_node_statistics {
    /// Requests that expect an answer.
    pub requests: u32,
    /// Answers in their window.
    pub replies: u32,
    /// Windows that closed without an answer, for whatever reason.
    pub timeouts: u32,
    /// Of these, windows with bytes but no packet.
    pub crc_errors: u32,
    /// Answers that came before the line could have carried them.
    pub early: u32,
    /// Answers outside their window, or in that of another node.
    pub late: u32,
    /// Answers of another mode than known.
    pub other_mode: u32,
    /// Requests that were repeated.
    pub retries: u32,
    /// READs that failed after all attempts.
    pub failures: u32,
    /// From the end of a request to the start of its answer.
    pub latency: axle_latency,
}

impl From<&NodeStatistics> for axle_ikeya_node_statistics {
    fn from(of: &NodeStatistics) -> Self {
        Self {
            requests: of.requests,
            replies: of.replies,
            timeouts: of.timeouts,
            crc_errors: of.crc_errors,
            early: of.early,
            late: of.late,
            other_mode: of.other_mode,
            retries: of.retries,
            failures: of.failures,
            latency: of.latency.into(),
        }
    }
}

object! {
    /// The master of a bus of boards with one motor.
    axle_ikeya_master, AXLE_IKEYA_MASTER_SIZE = 2288, 286 words of Master<OneMotor>, b"axM1"
}

object! {
    /// The master of a bus of boards with three motors.
    axle_ikeya3_master, AXLE_IKEYA3_MASTER_SIZE = 2616, 327 words of Master<ThreeMotors>, b"axM3"
}

/// Settings for one of the processor's own UARTs: 500 kbit/s, answers within 500 us.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_master_config_direct(
    config: *mut axle_ikeya_master_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(MasterConfig::direct().into()))
}

/// Settings for a USB adapter, which may delay an answer by 16 ms: answers within 20 ms.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_master_config_usb_adapter(
    config: *mut axle_ikeya_master_config,
) -> axle_result {
    Out::new(config).map_or_else(|error| error, |out| out.write(MasterConfig::usb_adapter().into()))
}

fn of_node<M: Memory>(
    master: *mut M,
    node: u8,
    call: impl FnOnce(&mut M::Value, NodeId) -> axle_result,
) -> axle_result {
    match node_from(node) {
        Ok(node) => enter(master, |master| call(master, node)).unwrap_or_else(|error| error),
        Err(error) => error,
    }
}

fn set_velocity<B: Motors>(
    master: &mut Master<B>,
    node: NodeId,
    rps: [f32; 3],
    now_us: u64,
) -> axle_result {
    match B::velocity(rps) {
        Ok(rps) => of(master.set_velocity(node, rps, at(now_us)).map_err(of_master)),
        Err(error) => of_encode(error),
    }
}

fn set_position<B: Motors>(
    master: &mut Master<B>,
    node: NodeId,
    positions: [axle_ikeya_position; 3],
    now_us: u64,
) -> axle_result {
    let position = B::position(positions.map(Into::into));
    of(master.set_position(node, position, at(now_us)).map_err(of_master))
}

fn target<B: Motors>(motion: axle_ikeya_motion) -> Result<Target<B>, axle_result> {
    match motion.mode {
        AXLE_IKEYA_MODE_VELOCITY => {
            B::velocity(motion.velocity_rps).map(Target::Velocity).map_err(of_encode)
        }
        AXLE_IKEYA_MODE_POSITION => {
            Ok(Target::Position(B::position(motion.position.map(Into::into))))
        }
        _ => Err(AXLE_ERROR_VALUE),
    }
}

/// The functions of a master with these names, besides those of every role.
macro_rules! master {
    ($master:ident: $init:ident $event:ident $discover:ident $stop:ident $stop_all:ident
        $check:ident $read:ident $confirm:ident $keep_alive:ident $release:ident $node:ident $bus:ident
        $statistics:ident $node_statistics:ident $counters:ident) => {
        /// Makes a master that knows no node yet: call `discover`. `size` is `sizeof *master`.
        /// Never call it during another call with the same object.
        #[unsafe(no_mangle)]
        pub extern "C" fn $init(
            master: *mut $master,
            size: usize,
            config: *const axle_ikeya_master_config,
            now_us: u64,
        ) -> axle_result {
            init(master, size, || Ok(Master::for_board(read(config)?.try_into()?, at(now_us))))
        }

        /// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
        #[unsafe(no_mangle)]
        pub extern "C" fn $event(
            master: *mut $master,
            event: *mut axle_ikeya_master_event,
        ) -> axle_result {
            get(master, event, |master| master.poll_event().map(Into::into))
        }

        /// Asks all ids of this bus that are not online. During a discovery it changes nothing.
        #[unsafe(no_mangle)]
        pub extern "C" fn $discover(master: *mut $master, now_us: u64) -> axle_result {
            of(enter(master, |master| master.discover(at(now_us))))
        }

        /// Stops a node: sent before anything else, and repeated until the motor is seen to be at
        /// rest, or until a set-point, which is refused before the stop is confirmed (I12).
        ///
        /// `get_node` tells how far it is. After `stop_bound_us`, `coast_us` and `read_bound_us`, a
        /// node that is not seen to stand still may be moving.
        #[unsafe(no_mangle)]
        pub extern "C" fn $stop(master: *mut $master, node: u8, now_us: u64) -> axle_result {
            of_node(master, node, |master, node| {
                master.stop(node, at(now_us));
                crate::result::AXLE_OK
            })
        }

        /// Stops all nodes of this bus, also those that do not answer (ruling I12).
        #[unsafe(no_mangle)]
        pub extern "C" fn $stop_all(master: *mut $master, now_us: u64) -> axle_result {
            of(enter(master, |master| master.stop_all(at(now_us))))
        }

        /// Checks whether a command with this motion would be accepted at the time of the latest
        /// call; sends nothing. The dead-man may have fired since: `handle_timeout` tells. Fails as
        /// the command would, and with `AXLE_ERROR_VALUE` for a mode of another number.
        #[unsafe(no_mangle)]
        pub extern "C" fn $check(
            master: *const $master,
            node: u8,
            motion: *const axle_ikeya_motion,
        ) -> axle_result {
            let check = || {
                let (node, target) = (node_from(node)?, target(read(motion)?)?);
                enter(master, |master| of(master.check(node, &target).map_err(of_master)))
            };
            check().unwrap_or_else(|error| error)
        }

        /// Reads a node soon; an event tells of the answer, or that it failed.
        #[unsafe(no_mangle)]
        pub extern "C" fn $read(master: *mut $master, node: u8, now_us: u64) -> axle_result {
            of_node(master, node, |master, node| {
                of(master.read(node, at(now_us)).map_err(of_master))
            })
        }

        /// Asks whether the set-point of a node has arrived; an event tells.
        #[unsafe(no_mangle)]
        pub extern "C" fn $confirm(master: *mut $master, node: u8, now_us: u64) -> axle_result {
            of_node(master, node, |master, node| {
                of(master.confirm(node, at(now_us)).map_err(of_master))
            })
        }

        /// Tells the dead-man that the application is there (ruling I13).
        #[unsafe(no_mangle)]
        pub extern "C" fn $keep_alive(master: *mut $master, now_us: u64) -> axle_result {
            of(enter(master, |master| master.keep_alive(at(now_us))))
        }

        /// Forgets the set-point of a node, which keeps following it.
        #[unsafe(no_mangle)]
        pub extern "C" fn $release(master: *mut $master, node: u8) -> axle_result {
            of_node(master, node, |master, node| {
                master.release(node);
                crate::result::AXLE_OK
            })
        }

        /// What is known of a node.
        #[unsafe(no_mangle)]
        pub extern "C" fn $node(
            master: *const $master,
            node: u8,
            known: *mut axle_ikeya_node,
        ) -> axle_result {
            match node_from(node) {
                Ok(node) => get(master, known, |master| Some(node_of(master, node))),
                Err(error) => error,
            }
        }

        /// What is known of the bus.
        #[unsafe(no_mangle)]
        pub extern "C" fn $bus(master: *const $master, known: *mut axle_ikeya_bus) -> axle_result {
            get(master, known, |master| Some(bus_of(master)))
        }

        /// The counts so far.
        #[unsafe(no_mangle)]
        pub extern "C" fn $statistics(
            master: *const $master,
            counts: *mut axle_ikeya_master_statistics,
        ) -> axle_result {
            get(master, counts, |master| Some((*master.statistics()).into()))
        }

        /// The counts of a node so far.
        #[unsafe(no_mangle)]
        pub extern "C" fn $node_statistics(
            master: *const $master,
            node: u8,
            counts: *mut axle_ikeya_node_statistics,
        ) -> axle_result {
            match node_from(node) {
                Ok(node) => get(master, counts, |master| Some(master.node_statistics(node).into())),
                Err(error) => error,
            }
        }

        /// The account of the bytes received.
        #[unsafe(no_mangle)]
        pub extern "C" fn $counters(
            master: *const $master,
            account: *mut axle_counters,
        ) -> axle_result {
            get(master, account, |master| Some(master.counters().into()))
        }
    };
}

master!(axle_ikeya_master:
    axle_ikeya_master_init axle_ikeya_master_poll_event axle_ikeya_master_discover
    axle_ikeya_master_stop axle_ikeya_master_stop_all axle_ikeya_master_check axle_ikeya_master_read
    axle_ikeya_master_confirm axle_ikeya_master_keep_alive axle_ikeya_master_release
    axle_ikeya_master_get_node axle_ikeya_master_get_bus axle_ikeya_master_get_statistics
    axle_ikeya_master_get_node_statistics axle_ikeya_master_get_counters);
endpoint!(axle_ikeya_master:
    axle_ikeya_master_handle_input axle_ikeya_master_handle_old_input
    axle_ikeya_master_handle_timeout axle_ikeya_master_poll_transmit
    axle_ikeya_master_handle_transmit axle_ikeya_master_is_outdated
    axle_ikeya_master_next_deadline axle_ikeya_master_get_line_rules);
master!(axle_ikeya3_master:
    axle_ikeya3_master_init axle_ikeya3_master_poll_event axle_ikeya3_master_discover
    axle_ikeya3_master_stop axle_ikeya3_master_stop_all axle_ikeya3_master_check
    axle_ikeya3_master_read
    axle_ikeya3_master_confirm axle_ikeya3_master_keep_alive axle_ikeya3_master_release
    axle_ikeya3_master_get_node axle_ikeya3_master_get_bus axle_ikeya3_master_get_statistics
    axle_ikeya3_master_get_node_statistics axle_ikeya3_master_get_counters);
endpoint!(axle_ikeya3_master:
    axle_ikeya3_master_handle_input axle_ikeya3_master_handle_old_input
    axle_ikeya3_master_handle_timeout axle_ikeya3_master_poll_transmit
    axle_ikeya3_master_handle_transmit axle_ikeya3_master_is_outdated
    axle_ikeya3_master_next_deadline axle_ikeya3_master_get_line_rules);

/// Turns a motor at this speed, turns per second, from now on.
///
/// Fails with `AXLE_ERROR_NOT_ONLINE`, `AXLE_ERROR_WRONG_MODE`, `AXLE_ERROR_MODE_IN_DOUBT`,
/// `AXLE_ERROR_STOP_OWED`, `AXLE_ERROR_NOT_FINITE` or `AXLE_ERROR_NODE_ID`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_master_set_velocity(
    master: *mut axle_ikeya_master,
    node: u8,
    rps: f32,
    now_us: u64,
) -> axle_result {
    of_node(master, node, |master, node| set_velocity(master, node, [rps, 0.0, 0.0], now_us))
}

/// Moves a motor to this position.
///
/// Fails as `axle_ikeya_master_set_velocity`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_master_set_position(
    master: *mut axle_ikeya_master,
    node: u8,
    position: axle_ikeya_position,
    now_us: u64,
) -> axle_result {
    of_node(master, node, |master, node| set_position(master, node, [position; 3], now_us))
}

/// Turns the three motors of a node at these speeds, turns per second; `rps` has three elements.
///
/// Fails as `axle_ikeya_master_set_velocity`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya3_master_set_velocity(
    master: *mut axle_ikeya3_master,
    node: u8,
    rps: *const f32,
    now_us: u64,
) -> axle_result {
    match read(rps.cast::<[f32; 3]>()) {
        Ok(rps) => of_node(master, node, |master, node| set_velocity(master, node, rps, now_us)),
        Err(error) => error,
    }
}

/// Moves the three motors of a node to these positions; `positions` has three elements.
///
/// Fails as `axle_ikeya_master_set_velocity`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya3_master_set_position(
    master: *mut axle_ikeya3_master,
    node: u8,
    positions: *const axle_ikeya_position,
    now_us: u64,
) -> axle_result {
    match read(positions.cast::<[axle_ikeya_position; 3]>()) {
        Ok(to) => of_node(master, node, |master, node| set_position(master, node, to, now_us)),
        Err(error) => error,
    }
}
plain!([f32; 3], [axle_ikeya_position; 3]);
