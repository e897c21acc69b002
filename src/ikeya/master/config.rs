//! Settings of a master.

use super::nodes::NodeSet;
use crate::{ikeya::units::BAUD, time::Duration};

/// Settings of a [`Master`](super::Master): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// ```
/// use axlewire::{ikeya::{master::{MasterConfig, NodeSet}, NodeId}, time::Duration};
/// let mut config = MasterConfig::usb_adapter();
/// config.reply_timeout = Duration::from_millis(5); // an adapter with its latency timer set to 1 ms
/// config.nodes = [NodeId::N1, NodeId::N2].into_iter().collect(); // the whole bus
/// config.dead_man = Some(Duration::from_millis(500));
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MasterConfig {
    /// Speed of the line, bit/s.
    pub baud: u32,
    /// Ids on this bus; all eight by default. A discovery asks these, and
    /// [`stop_all`](super::Master::stop_all) is not done before each of them has stopped (I12).
    pub nodes: NodeSet,
    /// Time that an answer may take to begin, from the end of the request on the wire. The wire
    /// time of the answer is added (I7).
    pub reply_timeout: Duration,
    /// Time after a missed answer in which the node is not asked again, so that a late answer meets
    /// a closed window. Other nodes are asked meanwhile.
    pub late_guard: Duration,
    /// Silence kept after a request or an answer before the next request, for transceivers that
    /// need it.
    pub turnaround_gap: Duration,
    /// Attempts of a READ before it is reported as failed (I8); 0 counts as 1.
    pub attempts: u8,
    /// When nodes are read.
    pub polling: Polling,
    /// Share of the line's time that the search for abnormal nodes may take, percent. 0 searches
    /// only for nodes that are owed a stop, and for those at 1 %; more than 50 counts as 50.
    pub recovery_share_pct: u8,
    /// Whether this is a 2-wire line whose adapter hears its own bytes: they are then removed.
    pub removes_echo: bool,
    /// Whether an answer may arrive before the line could have carried it, as behind a pipe, a
    /// socket or an emulator. Otherwise such bytes are older than the request: they are counted as
    /// [`early`](super::NodeStatistics::early) and not taken. Set it as well for a clock coarser
    /// than 50 µs.
    pub accepts_early: bool,
    /// Greatest age that a measured position may have when a stop is asked for, so that the stop
    /// holds it without reading a new one; zero by default: always read (I6). Where it cannot be
    /// written within 20 ms, a new one is read all the same.
    pub hold_age: Duration,
    /// Dead-man: after this much time without an accepted set-point, a stop or
    /// [`keep_alive`](super::Master::keep_alive), every node under a set-point is owed a stop (I13).
    /// `None`, the default, trusts the application.
    pub dead_man: Option<Duration>,
    /// Whether a node that becomes abnormal under a set-point is owed a stop (I12); on by default,
    /// because a slave keeps its last command.
    pub stops_abnormal: bool,
}

/// When a master reads its nodes.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polling {
    /// One after the other, as fast as the line allows.
    Fastest,
    /// Each node once in this time; its set-point is repeated as often.
    Every(Duration),
    /// Only when asked; a set-point is then sent when it is given and with each read. Stops are
    /// repeated and confirmed all the same (I12); to see a standstill, ask.
    Manual,
}

impl MasterConfig {
    /// For a UART of the processor itself: 500 kbit/s, answers within 500 µs.
    #[must_use]
    pub const fn direct() -> Self {
        Self {
            baud: BAUD,
            nodes: NodeSet::ALL,
            reply_timeout: Duration::from_micros(500),
            late_guard: Duration::from_micros(500),
            turnaround_gap: Duration::ZERO,
            attempts: 3,
            polling: Polling::Fastest,
            recovery_share_pct: 5,
            removes_echo: false,
            accepts_early: false,
            hold_age: Duration::ZERO,
            dead_man: None,
            stops_abnormal: true,
        }
    }

    /// For a USB adapter, which may hold back an answer for 16 ms: answers within 20 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self {
            reply_timeout: Duration::from_millis(20),
            late_guard: Duration::from_millis(20),
            ..Self::direct()
        }
    }
}

/// [`direct`](MasterConfig::direct).
impl Default for MasterConfig {
    fn default() -> Self {
        Self::direct()
    }
}
