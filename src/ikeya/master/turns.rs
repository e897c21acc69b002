//! Turns: which requests may be sent next, why, and whose turn it is.

use crate::{
    ikeya::board::{Board, Target},
    time::Instant,
};

/// Kind of request.
#[derive(Clone, Copy, Debug)]
pub(super) enum Request<B: Board> {
    Read,
    Write(Target<B>),
}

impl<B: Board> Request<B> {
    /// Whether it is answered; a silent request is not.
    pub(super) const fn is_exchange(&self) -> bool {
        B::ANSWERS_WRITE || matches!(self, Self::Read)
    }
}

/// Reason for a request.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Reason {
    /// The WRITE of a freshly measured position: the second half of an attempt.
    Hold,
    /// A stop WRITE for a velocity node that is online.
    SpeedStop,
    /// A stop WRITE for any node that is online.
    Stop,
    /// A READ that a stop or a mode in doubt is waiting for.
    StopRead,
    /// The first attempt for a node that is owed a stop and is not online.
    LostStop,
    SetPoint,
    Discovery,
    Search,
    Cycle,
}

impl Reason {
    /// The urgent reasons by priority, then the rest.
    pub(super) const ALL: [Self; 9] = [
        Self::Hold,
        Self::SpeedStop,
        Self::Stop,
        Self::StopRead,
        Self::LostStop,
        Self::SetPoint,
        Self::Discovery,
        Self::Search,
        Self::Cycle,
    ];

    /// Whether it is for a stop or a mode in doubt.
    pub(super) const fn is_stop(self) -> bool {
        matches!(self, Self::Hold | Self::SpeedStop | Self::Stop | Self::StopRead | Self::LostStop)
    }
}

/// One request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice<B: Board> {
    pub(super) index: usize,
    pub(super) request: Request<B>,
    pub(super) reason: Reason,
    pub(super) round: Round,
}

/// Round of a request: the one in progress, or the next, in which each node has its turns again.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Round {
    Same,
    Next,
}

/// The request handed out last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent<B: Board> {
    pub(super) choice: Choice<B>,
    /// Earliest time at which its first byte could leave.
    pub(super) start: Instant,
    pub(super) len: usize,
}

/// Whose turn it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turns {
    /// Index of the last node served with a stop.
    pub(super) stop: usize,
    /// Index of the last node served with a new set-point.
    pub(super) set_point: usize,
    /// Index of the node whose turn in the cycle it is.
    pub(super) cycle: usize,
    /// Turns of the cycle that go before a discovery.
    pub(super) cycle_first: u8,
    is_second_discovery: bool,
    /// Whether the last round ended with an exchange of the search.
    pub(super) was_search: bool,
    /// Nodes that have had their exchange for a stop in this round, one bit each.
    pub(super) had_stop: u8,
    /// Nodes that have had their new set-point in this round, one bit each.
    pub(super) had_set_point: u8,
}

impl Turns {
    /// Ends a discovery: after every second one each node first has its turn in the cycle.
    pub(super) const fn end_discovery(&mut self) {
        self.is_second_discovery = !self.is_second_discovery;
        if !self.is_second_discovery {
            self.cycle_first = 8;
        }
    }

    /// Whether it is this node's turn; a regular request is always for the next round. A stop WRITE
    /// is followed by a READ before it is repeated, so it needs no turn of its own unless it is
    /// answered.
    pub(super) fn has<B: Board>(&self, index: usize, reason: Reason, round: Round) -> bool {
        let had = match reason {
            _ if round == Round::Next => 0,
            Reason::SpeedStop | Reason::Stop if !B::ANSWERS_WRITE => 0,
            Reason::SetPoint => self.had_set_point,
            // Directly behind its READ.
            Reason::Hold => 0,
            _ => self.had_stop,
        };
        had >> index & 1 == 0
    }
}

/// Progress of a discovery: each id once, then all again.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Discovery {
    pub(super) step: u16,
}

impl Discovery {
    /// Index of the node to be polled next.
    pub(super) const fn index(self) -> usize {
        (self.step & 7) as usize
    }

    /// Number of times each id has been polled before.
    pub(super) const fn pass(self) -> u16 {
        self.step >> 3
    }
}

/// The search for nodes that do not answer, one at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Search {
    /// Time before which no node is polled.
    pub(super) next_at: Option<Instant>,
    /// Index of the node polled last.
    pub(super) last: usize,
}
