//! Modes: the effect of an answer in another mode (I11).

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
    /// The mode on record, or the first one heard.
    Agreed,
    /// The mode on record, which was in doubt until now.
    Settled,
    /// The other mode for the first time: nothing is decided.
    Doubtful,
    /// The other mode again.
    Changed,
}

impl<B: Board> Node<B> {
    /// Records the mode of an answer in its window.
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

    /// Puts the mode in doubt; a held position must be measured again. Returns whether that ends a
    /// confirmation.
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

    /// Handles an answer outside its window: it can put the mode in doubt, but decides nothing.
    pub(super) fn hear_mode_outside_window(&mut self, id: NodeId, mode: Mode) {
        if self.node(id).mode.is_some_and(|known| known != mode) {
            self.doubt_mode(id);
        }
    }

    /// Handles an answer in its window that has put the mode in doubt.
    pub(super) fn hear_doubtful(&mut self, id: NodeId, status: &Status<B>) {
        self.doubt_mode(id);
        let now = self.now;
        if let Some(stop) = &mut self.node_mut(id).stop {
            stop.measure(status, now);
        }
    }

    /// Counts an exchange with a node in doubt that has decided nothing.
    pub(super) fn count_doubtful_exchange(&mut self, id: NodeId) {
        let node = self.node_mut(id);
        let Some(exchanges) = &mut node.doubt else { return };
        let was = *exchanges;
        *exchanges = was.saturating_add(1).min(DOUBT_EXCHANGES);
        if was + 1 == DOUBT_EXCHANGES {
            self.tell_undecided(id);
        }
    }

    /// Reports that the mode stays in doubt.
    pub(super) fn tell_undecided(&mut self, node: NodeId) {
        let event = match self.node(node).stop {
            Some(_) => MasterEvent::StopBlocked { node },
            None => MasterEvent::ModeInDoubt { node },
        };
        self.tell(event);
    }

    /// Ends the doubt. Anything measured during it no longer counts, and if the mode has changed,
    /// the node's command was meant for the old one.
    pub(super) fn end_doubt(&mut self, id: NodeId, mode: Mode, decision: Decision) {
        let node = self.node_mut(id);
        if let Some(stop) = &mut node.stop {
            stop.restart();
        }
        if decision == Decision::Changed {
            // The last WRITE may have been read in the new mode, where 0 rps means "go to 0".
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
