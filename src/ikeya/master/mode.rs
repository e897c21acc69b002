//! Modes: what an answer in another mode does, and who decides (I11).

use super::{
    event::{Cause, MasterEvent},
    node::{DOUBT_EXCHANGES, Node},
    role::Master,
    set_point::{Confirm, SetPoint},
    stop::{Standstill, Stop},
};
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::{Mode, NodeId},
    },
    stats::count_apart,
};

/// What an answer says about the mode.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Decision {
    /// It is the mode on record, or the first one heard.
    Agreed,
    /// It is the mode on record, which was in doubt until now.
    Settled,
    /// It is the other one for the first time: nothing is decided.
    Doubtful,
    /// It is the other one again.
    Changed,
}

impl<B: Board> Node<B> {
    /// Takes in the mode of an answer in its window.
    pub(super) fn decide(&mut self, mode: Mode) -> Decision {
        let decision = match (self.mode, self.doubt) {
            (Some(known), None) if known != mode => Decision::Doubtful,
            (Some(known), Some(_)) if known != mode => Decision::Changed,
            (Some(_), Some(_)) => Decision::Settled,
            _ => Decision::Agreed,
        };
        if decision != Decision::Doubtful {
            (self.mode, self.doubt) = (Some(mode), None);
        }
        decision
    }

    /// Puts the mode in doubt. A position that was held is to be measured anew. Says whether that
    /// ends a confirmation.
    fn doubt_mode(&mut self) -> bool {
        count_apart(&mut self.statistics.other_mode);
        if self.doubt.is_some() {
            return false;
        }
        self.doubt = Some(0);
        if let Some(stop) = &mut self.stop {
            stop.restart();
        }
        let is_hold = matches!(
            self.set_point,
            Some(SetPoint { target: Target::Position(_), is_stop: true, .. })
        );
        if is_hold {
            self.standstill = Standstill::Unwatched;
            self.stop.get_or_insert(Stop::new(None, None));
            return self.drop_set_point();
        }
        if self.confirm == Confirm::AfterAnswer {
            // The WRITE may have been read in the other mode.
            self.confirm = Confirm::AfterWrite;
        }
        false
    }
}

impl<B: Board> Master<B> {
    fn doubt_mode(&mut self, node: NodeId) {
        if self.node_mut(node).doubt_mode() {
            self.tell(MasterEvent::NotConfirmed { node, cause: Cause::Dropped });
        }
    }

    /// An answer outside its window can put the mode in doubt, and decides nothing.
    pub(super) fn hear_mode_outside_window(&mut self, id: NodeId, mode: Mode) {
        if self.node(id).mode.is_some_and(|known| known != mode) {
            self.doubt_mode(id);
        }
    }

    /// An answer in its window has put the mode in doubt.
    pub(super) fn hear_doubtful(&mut self, id: NodeId, status: &Status<B>) {
        self.doubt_mode(id);
        let now = self.now;
        if let Some(stop) = &mut self.node_mut(id).stop {
            stop.measure(status, now);
        }
    }

    /// An exchange with a node in doubt has decided nothing.
    pub(super) fn count_doubtful_exchange(&mut self, id: NodeId) {
        let node = self.node_mut(id);
        let Some(exchanges) = &mut node.doubt else { return };
        let was = *exchanges;
        *exchanges = was.saturating_add(1).min(DOUBT_EXCHANGES);
        if was + 1 == DOUBT_EXCHANGES {
            self.tell_undecided(id);
        }
    }

    /// Says that the mode stays in doubt.
    pub(super) fn tell_undecided(&mut self, node: NodeId) {
        let event = match self.node(node).stop {
            Some(_) => MasterEvent::StopBlocked { node },
            None => MasterEvent::ModeInDoubt { node },
        };
        self.tell(event);
    }

    /// The doubt is over. What was measured in it no longer counts, and if the mode has changed,
    /// what the node was told was meant for the old one.
    pub(super) fn end_doubt(&mut self, id: NodeId, mode: Mode, decision: Decision) {
        let node = self.node_mut(id);
        if let Some(stop) = &mut node.stop {
            stop.restart();
        }
        if decision == Decision::Changed {
            // The last WRITE may have been read in the new mode: 0 rps are "go to 0" there.
            let was_commanded = node.is_commanded();
            node.standstill = Standstill::Unwatched;
            self.drop_set_point(id);
            if was_commanded {
                self.owe_stop(id);
            }
            self.tell(MasterEvent::ModeChanged { node: id, mode });
        }
    }
}
