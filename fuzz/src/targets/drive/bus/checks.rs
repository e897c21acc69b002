//! What must hold after a call of a master's driver.

use axlewire::{
    drive::DriveError,
    ikeya::{NodeId, WriteRequest, board::Status, master::NodeSet},
};

use super::{
    super::{
        bus_peer::{Heard, paid},
        rig::{Before, Wired},
    },
    BusLife, index,
};

impl<P: Wired> BusLife<P>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    pub(super) fn logs(&self) -> [usize; 8] {
        self.peer.0.borrow().log.each_ref().map(Vec::len)
    }

    /// Notes since when stops are owed.
    pub(super) fn follow(&mut self, logs: &[usize; 8]) {
        let role = self.rig.driver.role();
        let owed = role.stops_owed();
        self.coasting = role.coasting();
        for node in NodeId::ALL {
            let since = &mut self.owed_from[index(node)];
            match owed.contains(node) {
                true => drop(since.get_or_insert(logs[index(node)])),
                false => *since = None,
            }
        }
    }

    /// `Ok` means that the WRITE is on the line.
    pub(super) fn check_set<E>(
        &mut self,
        done: Option<Result<(), DriveError<E>>>,
        write: &[u8],
        before: &Before,
    ) {
        match done {
            Some(Ok(())) => {
                let port = self.rig.port();
                let begin = before.taken.saturating_sub(write.len());
                let taken = &port.written[begin..port.flushed_bytes];
                let is_out = taken.windows(write.len()).any(|window| window == write);
                assert!(is_out, "Ok, but the set-point was not sent and flushed");
            }
            Some(Err(DriveError::Bus(_))) | None => {}
            Some(Err(_)) => {
                let node = NodeId::new(write[1]).expect("a node");
                let role = self.rig.driver.role();
                assert!(role.set_point(node).is_none(), "a failed call leaves its set-point");
            }
        }
    }

    pub(super) fn check_read<E>(
        &self,
        node: NodeId,
        done: Option<Result<Status, DriveError<E>>>,
        log: usize,
    ) {
        let Some(Ok(status)) = done else { return };
        let payload = match status {
            Status::Velocity(rps) => rps.to_le_bytes(),
            Status::Position(at) => WriteRequest::position(node, at).payload(),
        };
        let nodes = self.peer.0.borrow();
        // The request may have left before this call.
        let log = &nodes.log[index(node)][log.saturating_sub(1)..];
        assert!(log.contains(&Heard::Answered(payload)), "{status:?} was not answered: {log:?}");
    }

    /// `Ok` means that two stop WRITEs have each been followed by an answer, and that the last
    /// command which the node has accepted is a stop (I12).
    pub(super) fn check_stop<E: core::fmt::Debug>(
        &mut self,
        nodes: NodeSet,
        done: Option<Result<(), DriveError<E>>>,
        logs: &[usize; 8],
        is_calm: bool,
    ) {
        let owed = self.rig.driver.role().stops_owed().and(nodes);
        match done {
            Some(Ok(())) => {
                assert!(owed.is_empty(), "Ok, but {owed:?} are owed a stop");
                for node in nodes.iter() {
                    // A call joins a stop that is confirmed.
                    if !self.coasting.contains(node) {
                        self.check_paid(node, logs[index(node)]);
                    }
                    self.check_obeyed(node);
                }
            }
            Some(Err(DriveError::StillMoving(told))) => {
                let is_deaf = self.peer.0.borrow().is_deaf;
                let moves = told.iter().any(|node| is_deaf[index(node)]);
                assert!(moves || !told.is_empty() && !is_calm, "{told:?} obey, but still move");
            }
            Some(Err(DriveError::StopsOwed(told))) => {
                assert!(!told.is_empty(), "an error without a node");
                // Nothing is in the way: what answers is paid.
                let is_there = self.peer.0.borrow().is_there;
                let silent = told.iter().any(|node| !is_there[index(node)]);
                assert!(silent || !is_calm, "{told:?} answer, but are owed a stop");
            }
            Some(Err(other)) => panic!("{other:?} from a stop"),
            None => {}
        }
    }

    pub(super) fn check_obeyed(&self, node: NodeId) {
        let is_told = self.peer.0.borrow().is_told_to_stop(index(node));
        assert!(is_told, "Ok, but node {node} obeys another command");
    }

    pub(super) fn check_paid(&self, node: NodeId, begun: usize) {
        let nodes = self.peer.0.borrow();
        let from = self.owed_from[index(node)].unwrap_or(begun).min(begun);
        let log = &nodes.log[index(node)][from..];
        let paid = paid(log, self.was_position[index(node)]);
        assert!(paid >= 2, "node {node} is paid by {log:?}");
    }
}
