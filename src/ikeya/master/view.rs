//! The getters of a master.

use super::{
    config::MasterConfig,
    event::{Cause, CommandError, Health},
    order::{Order, StopProgress},
    role::Master,
    statistics::{MasterStatistics, NodeStatistics},
};
use crate::ikeya::board::PACKET_LEN;
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        node_set::NodeSet,
        units::{Mode, NodeId},
    },
    stream::Counters,
    time::{Duration, Instant, wire_time},
};

impl<B: Board> Master<B> {
    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &MasterConfig {
        &self.config
    }

    /// Health of a node; `None` if it has never answered.
    #[must_use]
    pub fn health(&self, node: NodeId) -> Option<Health> {
        self.node(node).health()
    }

    /// Mode of a node on record; `None` if it has never answered.
    #[must_use]
    pub fn mode(&self, node: NodeId) -> Option<Mode> {
        self.node(node).mode().on_record()
    }

    /// Whether the mode of a node is in doubt (I11).
    #[must_use]
    pub fn is_mode_in_doubt(&self, node: NodeId) -> bool {
        self.node(node).mode().is_in_doubt()
    }

    /// Last measurement of a node, and when it arrived.
    #[must_use]
    pub fn status(&self, node: NodeId) -> Option<(Status<B>, Instant)> {
        self.node(node).status()
    }

    /// Progress of a node's latest stop.
    #[must_use]
    pub fn stop_progress(&self, node: NodeId) -> StopProgress {
        self.node(node).order().progress()
    }

    /// Nodes whose stop is not confirmed, including those that have never answered.
    #[must_use]
    pub fn stops_owed(&self) -> NodeSet {
        self.nodes_with(|order| order.stop_owed().is_some())
    }

    /// Nodes whose stop is confirmed and that were not seen to be still yet.
    #[must_use]
    pub fn coasting(&self) -> NodeSet {
        self.nodes_with(|order| order.coasting().is_some())
    }

    fn nodes_with(&self, has: impl Fn(&Order<B>) -> bool) -> NodeSet {
        NodeId::ALL.into_iter().filter(|&id| has(self.node(id).order())).collect()
    }

    /// Counts of a node.
    #[must_use]
    pub fn node_statistics(&self, node: NodeId) -> &NodeStatistics {
        self.node(node).statistics()
    }

    /// Counts of the line.
    #[must_use]
    pub const fn statistics(&self) -> &MasterStatistics {
        &self.statistics
    }

    /// Number of events lost because the application did not poll in time; saturates at 2^32 - 1.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.events.lost()
    }

    /// Accounts for every received byte.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.line.decoder().counters()
    }

    /// The set-point that is repeated for a node, or that of its confirmed stop; `None` without one
    /// and while a stop is not confirmed.
    #[must_use]
    pub fn set_point(&self, node: NodeId) -> Option<Target<B>> {
        self.node(node).order().target()
    }

    /// Whether the set-point of a node has been handed out for sending, and not been taken back.
    #[must_use]
    pub fn is_set_point_sent(&self, node: NodeId) -> bool {
        let order = self.node(node).order();
        order.target().is_some() && !order.is_new()
    }

    /// Why the last READ of a node that was given up failed; `None` if none has.
    #[must_use]
    pub fn last_failure(&self, node: NodeId) -> Option<Cause> {
        self.node(node).last_failure()
    }

    /// Result of the latest [`read`](Self::read) of a node: `Ok` once it has answered after the
    /// call, otherwise why the READ was given up. `None` while neither has happened.
    #[must_use]
    pub fn read_outcome(&self, node: NodeId) -> Option<Result<(), Cause>> {
        self.node(node).read_outcome()
    }

    /// Checks whether a command would be accepted at the time of the latest call. The dead-man may
    /// have fired since: [`handle_timeout`](crate::endpoint::Endpoint::handle_timeout) tells.
    ///
    /// # Errors
    ///
    /// Those of [`set_velocity`](Self::set_velocity) and [`set_position`](Self::set_position).
    pub fn check(&self, node: NodeId, target: &Target<B>) -> Result<(), CommandError> {
        self.node(node).check(node, target)
    }

    /// Whether a discovery is in progress.
    #[must_use]
    pub const fn is_discovering(&self) -> bool {
        self.queue.is_discovering()
    }

    /// Longest time from the first request of a READ to its answer or its
    /// [failure](crate::ikeya::master::MasterEvent::ReadFailed), on any line. It assumes that the
    /// driver is called in time, that the port holds no request back, and that no discovery or
    /// stop, which go first, is in progress.
    ///
    /// Between two attempts come the guard, one exchange with each other node and as many of the
    /// search for abnormal ones, and before each of these a new set-point for every node.
    #[must_use]
    pub fn read_bound(&self) -> Duration {
        let (write, exchange) = self.request_times();
        let set_point = if B::ANSWERS_WRITE { exchange } else { write };
        let round = exchange + set_point.saturating_mul(8);
        self.attempts_bound(round.saturating_mul(16))
    }

    /// Time within which a stop of nodes that are online is confirmed, with room for lost packets.
    /// A call that waits for stops gives up after it. A node that was abnormal when the call began
    /// may take longer, even if it answers again: it has its stop as soon as it can hear one (I13),
    /// but waits for its turn of the search to confirm it.
    ///
    /// It is four times [`MasterConfig::attempts`] times the longest time between two reads of a
    /// node while stops are owed: the guard, an exchange with every other node and with one that is
    /// searched for, and a WRITE to each. With a [`turnaround_gap`](MasterConfig::turnaround_gap)
    /// of milliseconds, or at a low speed, several position nodes may need longer.
    #[must_use]
    pub fn stop_bound(&self) -> Duration {
        let (write, exchange) = self.request_times();
        let round = exchange.saturating_mul(9) + write.saturating_mul(8);
        self.attempts_bound(round).saturating_mul(4)
    }

    /// Longest times for a WRITE without an answer, and for an exchange.
    fn request_times(&self) -> (Duration, Duration) {
        let gap = self.config.turnaround_gap;
        let write = wire_time(PACKET_LEN, self.config.baud) + gap;
        (write, write + self.line.window_time(&self.config) + gap)
    }

    fn attempts_bound(&self, between: Duration) -> Duration {
        let attempt = self.config.late_guard + between;
        attempt.saturating_mul(self.config.attempts.into())
    }
}
