//! Strikes: windows without the answer, and the search for abnormal nodes (I7).

use super::{
    event::{Cause, MasterEvent},
    health::Health,
    role::Master,
    set_point::Confirm,
    stop::{Standstill, Stop},
    turns::Search,
};
use crate::{
    ikeya::{board::Board, units::NodeId},
    stats::count_apart,
    time::{Duration, Instant},
};

/// Number of strikes after which a node is abnormal.
const STRIKES: u8 = 3;

/// Share of line time for nodes that are owed a stop when no others are searched for, percent.
const LEAST_SHARE_PCT: u8 = 1;

impl<B: Board> Master<B> {
    /// Records a window that closed without its answer.
    pub(super) fn strike(&mut self, id: NodeId, cause: Cause, deadline: Instant) {
        let (attempts, guard) = (self.config.attempts.max(1), self.config.late_guard);
        let node = self.node_mut(id);
        node.guarded_until = Some(deadline + guard);
        count_apart(&mut node.statistics.timeouts);
        if cause == Cause::Damaged {
            count_apart(&mut node.statistics.crc_errors);
        }
        if let Some(stop) = &mut node.stop {
            // The WRITE may have been lost: repeat it.
            stop.is_written = false;
        }
        self.count_doubtful_exchange(id);
        let node = self.node_mut(id);
        if !node.is_online() {
            return; // looked for, and not found
        }
        node.strikes = node.strikes.saturating_add(1);
        node.attempt = node.attempt.saturating_add(1);
        let is_abnormal = node.strikes >= STRIKES;
        let health = if is_abnormal { Health::Abnormal } else { Health::Suspect(node.strikes) };
        node.health = Some(health);
        let is_failed = is_abnormal || node.attempt >= attempts;
        let mut is_unconfirmed = false;
        if is_failed {
            (node.attempt, node.last_failure, node.has_failed) = (0, Some(cause), true);
            count_apart(&mut node.statistics.failures);
            is_unconfirmed =
                core::mem::replace(&mut node.confirm, Confirm::Unasked) != Confirm::Unasked;
        }
        self.tell(MasterEvent::Health { node: id, health });
        if is_failed {
            self.tell(MasterEvent::ReadFailed { node: id, cause });
        }
        if is_unconfirmed {
            self.tell(MasterEvent::NotConfirmed { node: id, cause });
        }
        if is_abnormal {
            self.lose(id);
        }
    }

    /// Handles a node that has become abnormal: it keeps its last command, so it is owed a stop.
    fn lose(&mut self, id: NodeId) {
        let stops = self.config.stops_abnormal;
        let node = self.node_mut(id);
        let was_commanded = node.is_commanded();
        node.set_point = None;
        node.standstill = Standstill::Unwatched;
        if let Some(stop) = &mut node.stop {
            *stop = Stop::new(None, None);
        } else if stops && was_commanded {
            self.owe_stop(id);
        }
    }

    /// Records a request of the search, and computes when the next is due.
    pub(super) fn searched(&mut self, index: usize, now: Instant) {
        let share = self.config.recovery_share_pct.clamp(LEAST_SHARE_PCT, 50);
        let exchange = self.window_time() + self.config.turnaround_gap;
        let whole = exchange.saturating_mul(100).as_micros();
        let pause = whole.checked_div(share.into()).unwrap_or(u32::MAX);
        self.search = Search { next_at: Some(now + Duration::from_micros(pause)), last: index };
    }
}
