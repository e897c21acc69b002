//! Settings of a master.

use crate::{
    ikeya::{node_set::NodeSet, units::BAUD},
    time::Duration,
};

/// Settings of a [`Master`](crate::ikeya::Master): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// ```
/// use axlewire::{ikeya::{master::{MasterConfig, NodeSet}, NodeId}, time::Duration};
/// let mut config = MasterConfig::usb_adapter();
/// config.reply_timeout = Duration::from_millis(5); // an adapter with a latency timer of 1 ms
/// config.nodes = [NodeId::N1, NodeId::N2].into(); // the whole bus
/// config.dead_man = Some(Duration::from_millis(500));
/// config.hold_age = Duration::from_millis(10); // a stop may hold the last answer, see there
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MasterConfig {
    /// Speed of the line, bit/s; 0 counts as 500,000. Not less than it really is: a pause inside a
    /// packet would count as its time on the line.
    pub baud: u32,
    /// Ids on this bus; all eight by default. A discovery polls these, and
    /// [`stop_all`](crate::ikeya::Master::stop_all) is done only when each of them has stopped
    /// (I12).
    pub nodes: NodeSet,
    /// Longest time from the end of the request on the wire to the start of the answer. The wire
    /// time of the answer is added (I7).
    pub reply_timeout: Duration,
    /// Time after a missed answer during which the node is not polled again, so that a late answer
    /// meets a closed window. Other nodes are polled meanwhile.
    pub late_guard: Duration,
    /// Minimum silence between a request or an answer and the next request, for transceivers that
    /// need it. Not behind an answer that comes outside its window.
    pub turnaround_gap: Duration,
    /// Attempts of a READ before it is reported as failed (I8); 0 counts as 1.
    pub attempts: u8,
    /// When nodes are read.
    pub polling: Polling,
    /// Search rate: share of line time spent on finding abnormal nodes while online nodes have
    /// requests due, percent. An idle line is searched all the time. 0 searches only for nodes
    /// that are owed a stop, at 1 %; more than 50 counts as 50 (I13).
    pub recovery_share_pct: u8,
    /// Whether an answer may arrive before the line could have carried it, as behind a pipe, a
    /// socket or an emulator. Otherwise such bytes must be older than the request: they are
    /// counted as [`early`](super::NodeStatistics::early) and ignored. Also set it if the
    /// [clock](crate::drive::Clock) is coarser than 20 µs.
    pub accepts_early: bool,
    /// Maximum age of a measured position that a stop may hold without reading a new one; zero by
    /// default: always read (I6). If it cannot be written within 20 ms, a new one is read anyway.
    /// The age counts from when the driver took the answer: add the longest time between two of
    /// your calls, for which an answer may wait in the port.
    pub hold_age: Duration,
    /// Time in which a motor may come to rest after its stop is confirmed; 2 s by default. Then
    /// [`MasterEvent::StillMoving`](super::MasterEvent::StillMoving) reports that it still moves,
    /// or is not where it was told to hold (I12).
    pub coast: Duration,
    /// Dead-man: after this much time without an accepted set-point, a stop or
    /// [`keep_alive`](crate::ikeya::Master::keep_alive), every node under a set-point is owed a
    /// stop (I13). `None`, the default, disables it.
    pub dead_man: Option<Duration>,
    /// Whether a node that becomes abnormal while under a set-point is owed a stop (I12); on by
    /// default, because a slave keeps its last command.
    pub stops_abnormal: bool,
}

/// When a master reads its nodes.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polling {
    /// One after another, as fast as the line allows.
    Fastest,
    /// Each node once per period; its set-point is repeated at the same rate.
    Every(Duration),
    /// Only on request; a set-point is then sent when it is given and with each read. A node that
    /// is owed a stop is read and stopped in any case, until it is still (I12).
    Manual,
}

impl MasterConfig {
    /// For one of the processor's own UARTs: 500 kbit/s, answers within 500 µs.
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
            accepts_early: false,
            hold_age: Duration::ZERO,
            coast: Duration::from_secs(2),
            dead_man: None,
            stops_abnormal: true,
        }
    }

    /// For a USB adapter, which may delay an answer by 16 ms: answers within 20 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self {
            reply_timeout: Duration::from_millis(20),
            late_guard: Duration::from_millis(20),
            ..Self::direct()
        }
    }
}

/// Same as [`direct`](MasterConfig::direct).
impl Default for MasterConfig {
    fn default() -> Self {
        Self::direct()
    }
}
