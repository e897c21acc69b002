//! Replies and silences: what they change, and what the application is told of it.

use super::{
    event::MasterEvent,
    line::{Response, Window},
    node::Changes,
    role::Master,
};
use crate::{
    ikeya::{
        board::{Board, Status},
        units::NodeId,
    },
    time::Instant,
};

impl<B: Board> Master<B> {
    /// Handles a response.
    pub(super) fn hear(&mut self, id: NodeId, status: Status<B>, now: Instant) {
        let response = self.line.judge(id, &self.config, now);
        let coast = self.config.coast;
        let node = self.node_mut(id);
        let changes = match response {
            Response::Answer(latency) => node.hear_answer(&status, latency, coast, now),
            Response::Early => node.hear_outside_window(status.mode(), true),
            Response::Late => node.hear_outside_window(status.mode(), false),
        };
        self.tell_changes(id, &changes);
        if matches!(response, Response::Answer(_)) {
            self.settle_discovery();
        }
    }

    /// Handles a window that has closed without its answer.
    pub(super) fn miss(&mut self, window: Option<Window>) {
        let Some(window) = window else { return };
        let (config, guard) = (self.config, window.deadline + self.config.late_guard);
        let changes = self.node_mut(window.node).miss(window.cause(), &config, guard);
        self.tell_changes(window.node, &changes);
        self.settle_discovery();
    }

    pub(super) fn settle_discovery(&mut self) {
        if self.queue.settle_discovery(&self.nodes, &self.config) {
            let online = self.nodes.iter().filter(|node| node.is_online()).count();
            self.tell(MasterEvent::DiscoveryDone { online: online as u8 });
        }
    }

    /// Tells the application what has changed for a node.
    #[inline(never)]
    pub(super) fn tell_changes(&mut self, node: NodeId, changes: &Changes) {
        let it = self.node(node);
        let (mode, status, is_owed) =
            (it.mode().on_record(), it.status(), it.order().stop_owed().is_some());
        if changes.is_undecided {
            self.tell(match is_owed {
                true => MasterEvent::StopBlocked { node },
                false => MasterEvent::ModeInDoubt { node },
            });
        }
        if let (true, Some(mode)) = (changes.is_discovered, mode) {
            self.tell(MasterEvent::Discovered { node, mode });
        }
        if let Some(health) = changes.health {
            self.tell(MasterEvent::Health { node, health });
        }
        if let Some(cause) = changes.failed {
            self.tell(MasterEvent::ReadFailed { node, cause });
        }
        if let Some(cause) = changes.not_confirmed {
            self.tell(MasterEvent::NotConfirmed { node, cause });
        }
        if let (true, Some(mode)) = (changes.is_mode_changed, mode) {
            self.tell(MasterEvent::ModeChanged { node, mode });
        }
        if let (true, Some((status, _))) = (changes.is_answered, status) {
            self.events.push_frequent(MasterEvent::Status { node, status });
        }
        if changes.settled.is_confirmed {
            self.tell(MasterEvent::Confirmed { node });
        }
        if changes.settled.is_stopped {
            self.tell(MasterEvent::Stopped { node });
        }
        if changes.settled.is_still {
            self.tell(MasterEvent::StandingStill { node });
        }
        if let (true, Some((status, _))) = (changes.settled.is_still_moving, status) {
            self.tell(MasterEvent::StillMoving { node, status });
        }
    }
}
