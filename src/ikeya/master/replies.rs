//! Replies and silences: what they change, and what the application is told of it.

use super::{
    event::{Cause, Change, Changes, MasterEvent},
    line::{Response, Window},
    queue::index_of,
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
        let node = &mut self.nodes[index_of(id)];
        let changes = match response {
            Response::Answer { asked_at, latency } => {
                node.hear_answer(&status, asked_at, latency, &self.config, now)
            }
            Response::Early => node.hear_outside_window(status.mode(), true),
            Response::Late => node.hear_outside_window(status.mode(), false),
        };
        self.tell_changes(id, changes);
        if matches!(response, Response::Answer { .. }) {
            self.settle_discovery();
        }
    }

    /// Handles a window that has closed without its answer.
    pub(super) fn miss(&mut self, window: Option<Window>) {
        let Some(window) = window else { return };
        let (config, guard) = (self.config, window.deadline + self.config.late_guard);
        let changes = self.node_mut(window.node).miss(window.cause(), &config, guard);
        self.tell_changes(window.node, changes);
        self.settle_discovery();
    }

    pub(super) fn settle_discovery(&mut self) {
        if self.queue.settle_discovery(&self.nodes, &self.config) {
            let online = self.nodes.iter().filter(|node| node.is_online()).count();
            self.tell(MasterEvent::DiscoveryDone { online: online as u8 });
        }
    }

    /// Tells the application what has changed for a node.
    pub(super) fn tell_changes(&mut self, node: NodeId, changes: Changes) {
        for change in Change::ALL {
            if changes.has(change) {
                if let Some(event) = self.event(node, change) {
                    match change {
                        Change::Answered => self.events.push_frequent(event),
                        _ => self.events.push(event),
                    }
                }
            }
        }
    }

    fn event(&self, node: NodeId, change: Change) -> Option<MasterEvent<B>> {
        let it = self.node(node);
        Some(match change {
            Change::Undecided if it.order().stop_owed().is_some() => {
                MasterEvent::StopBlocked { node }
            }
            Change::Undecided => MasterEvent::ModeInDoubt { node },
            Change::Discovered => MasterEvent::Discovered { node, mode: it.mode().on_record()? },
            Change::Health => MasterEvent::Health { node, health: it.health()? },
            Change::Failed => MasterEvent::ReadFailed { node, cause: it.last_failure()? },
            Change::Unconfirmed => MasterEvent::NotConfirmed { node, cause: it.last_failure()? },
            Change::Dropped => MasterEvent::NotConfirmed { node, cause: Cause::Dropped },
            Change::Mode => MasterEvent::ModeChanged { node, mode: it.mode().on_record()? },
            Change::Answered => MasterEvent::Status { node, status: it.status()?.0 },
            Change::Confirmed => MasterEvent::Confirmed { node },
            Change::Stopped => MasterEvent::Stopped { node },
            Change::Still => MasterEvent::StandingStill { node },
            Change::StillMoving => MasterEvent::StillMoving { node, status: it.status()?.0 },
        })
    }
}
