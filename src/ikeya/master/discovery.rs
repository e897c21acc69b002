//! Discovery: polls every id that is not online, and silent ones again.

use super::{event::MasterEvent, role::Master, turns::Discovery};
use crate::ikeya::{board::Board, units::NodeId};

impl<B: Board> Master<B> {
    /// Begins a discovery, or joins the one in progress.
    pub(super) fn begin_discovery(&mut self) {
        if self.discovery.is_some() {
            return;
        }
        for node in &mut self.nodes {
            node.scans = 0;
        }
        self.discovery = Some(Discovery { step: 0 });
        self.settle_discovery();
    }

    /// Advances the discovery past ids that need no request, and ends it after the last.
    pub(super) fn settle_discovery(&mut self) {
        let Some(mut discovery) = self.discovery else { return };
        while discovery.pass() < self.config.attempts.max(1).into() {
            let node = &self.nodes[discovery.index()];
            let is_here = self.config.nodes.contains(NodeId::ALL[discovery.index()]);
            if is_here && !node.is_online() && u16::from(node.scans) <= discovery.pass() {
                self.discovery = Some(discovery);
                return;
            }
            discovery.step += 1;
        }
        self.discovery = None;
        self.turns.end_discovery();
        let online = self.nodes.iter().filter(|node| node.is_online()).count();
        self.tell(MasterEvent::DiscoveryDone { online: online as u8 });
    }
}
