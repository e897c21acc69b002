//! The dead-man: stops the nodes when the application is silent (I13).

use super::{event::MasterEvent, role::Master};
use crate::{
    ikeya::{board::Board, units::NodeId},
    stats::count_apart,
    time::{Instant, reached},
};

impl<B: Board> Master<B> {
    /// Records a sign of life, which does not revive an expired command.
    pub(super) fn sign_of_life(&mut self, now: Instant) {
        self.now = now;
        self.expire_commands(now);
        self.alive_at = now;
    }

    /// Time at which the dead-man stops the nodes.
    pub(super) fn dead_man_at(&self) -> Option<Instant> {
        let is_armed = self.nodes.iter().any(|node| node.is_under_order);
        self.config.dead_man.filter(|_| is_armed).map(|limit| self.alive_at + limit)
    }

    pub(super) fn expire_commands(&mut self, now: Instant) {
        if reached(self.dead_man_at(), now) {
            count_apart(&mut self.statistics.dead_man);
            self.tell(MasterEvent::DeadMan);
            for id in NodeId::ALL {
                if self.node(id).is_under_order {
                    self.owe_stop(id);
                }
            }
        }
    }
}
