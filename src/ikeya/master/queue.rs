//! The queue: which request goes next, and whose turn it is (I13).
//!
//! A request is either silent or an *exchange*, which is answered. Stops, reads about a mode in
//! doubt and new set-points are urgent. In each round a node has one urgent exchange for a stop and
//! one new set-point. A round ends with one regular exchange, if one is due: for the search for
//! abnormal nodes, a discovery, or the cycle. The search is not due twice in a row unless nothing
//! else is. Reading a position and holding it is one turn: the WRITE directly follows the answer,
//! even where it is an exchange of its own (three motors). So no node can starve the others:
//!
//! * a stop that is repeated blind, or because it is 20 ms old, has one silent WRITE behind each
//!   exchange;
//! * a stop of an online velocity node is sent right after the exchange in progress and at most
//!   seven other stop WRITEs; a stop of a position node is read after at most 16 more exchanges,
//!   with three motors 24, and written next;
//! * a new set-point waits for at most 16 exchanges and 14 other WRITEs, with three motors for 24
//!   exchanges, not counting a stop;
//! * a node in the cycle waits for at most 8 rounds of 17 exchanges, with three motors 25, for as
//!   many rounds of the search, and for two discoveries;
//! * the search waits for one round, even during a discovery.

use super::{
    config::MasterConfig,
    node::{Node, Reason},
};
use crate::{
    ikeya::{board::Board, units::NodeId},
    time::{Duration, Instant, reached},
};

/// Share of line time for nodes that are owed a stop when no others are searched for, percent.
const LEAST_SHARE_PCT: u8 = 1;

/// Whose turn it is.
// This order was found by trying: it takes less flash than others.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Queue {
    /// Index of the last node served with a stop.
    stop: usize,
    /// Index of the last node served with a new set-point.
    set_point: usize,
    /// Index of the node whose turn in the cycle it is.
    cycle: usize,
    /// Nodes that have had a stop repeated since the last exchange, one bit each.
    had_repeat: u8,
    /// Turns of the cycle that go before a discovery.
    cycle_first: u8,
    is_second_discovery: bool,
    /// Whether the last round ended with an exchange of the search.
    was_search: bool,
    /// Nodes that have had their exchange for a stop in this round, one bit each.
    had_stop: u8,
    /// Nodes that have had their new set-point in this round, one bit each.
    had_set_point: u8,
    discovery: Option<Discovery>,
    /// Time before which no abnormal node is searched for.
    search_at: Option<Instant>,
    /// Index of the node searched for last, among those that were heard before and are owed a
    /// stop, and among the others.
    searched_lost: usize,
    searched: usize,
    /// Whether the last one was of the former.
    was_lost: bool,
}

/// Whose turn it is, and why.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub(super) node: NodeId,
    round: Round,
    pub(super) reason: Reason,
}

/// Round of a request: the one in progress, or the next, in which each node has its turns again.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Round {
    Same,
    Next,
}

/// Progress of a discovery: each id once, then all again.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
struct Discovery {
    step: u16,
}

impl Discovery {
    /// Index of the node to be polled next.
    const fn index(self) -> usize {
        (self.step & 7) as usize
    }

    /// Number of times each id has been polled before.
    const fn pass(self) -> u16 {
        self.step >> 3
    }
}

/// What the queue chooses from: the nodes, the settings and the time.
#[derive(Clone, Copy)]
pub(super) struct View<'a, B: Board> {
    pub(super) nodes: &'a [Node<B>; 8],
    pub(super) config: &'a MasterConfig,
    pub(super) now: Instant,
}

impl Queue {
    /// Time at which the next request is due, regardless of the line.
    pub(super) fn due<B: Board>(&self, view: View<'_, B>) -> Option<Instant> {
        let mut earliest: Option<Instant> = None;
        for (index, node) in view.nodes.iter().enumerate() {
            for &reason in &Reason::ALL {
                let is_on = match (reason, self.discovery) {
                    (Reason::Discovery, Some(discovery)) => discovery.index() == index,
                    (Reason::Discovery, None) => false,
                    (Reason::Cycle, Some(_)) => self.cycle_first > 0,
                    _ => true,
                };
                let due_at = node.due_at(reason, view.config, view.now);
                if let Some(at) = due_at.filter(|_| is_on) {
                    earliest = Some(earliest.unwrap_or(at).min(at));
                }
            }
        }
        earliest
    }

    /// Chooses the request to send now, if any, regardless of the line.
    pub(super) fn choose<B: Board>(&self, view: View<'_, B>) -> Option<Turn> {
        let repeat = || self.next_of(Reason::Repeat, self.stop + 1, view, Round::Same, 0);
        self.urgent(view, Round::Same)
            .or_else(|| self.regular(view))
            // With no regular request due, the next round begins at once. Set-points that come
            // faster than the line takes them do not hold up the stops that are repeated.
            .or_else(|| match self.urgent(view, Round::Next) {
                Some(turn) if turn.reason == Reason::SetPoint => repeat().or(Some(turn)),
                turn => turn,
            })
            // An idle line belongs to the search.
            .or_else(|| self.search(view))
            // With nobody to be asked, a stop is repeated without an exchange in between.
            .or_else(repeat)
    }

    /// The next urgent request: for a stop, a mode in doubt or a new set-point.
    fn urgent<B: Board>(&self, view: View<'_, B>, round: Round) -> Option<Turn> {
        Reason::ALL[..7].iter().find_map(|&reason| {
            let last = if reason.is_stop() { self.stop } else { self.set_point };
            self.next_for(reason, last + 1, view, round)
        })
    }

    /// The next regular request; it ends the round.
    fn regular<B: Board>(&self, view: View<'_, B>) -> Option<Turn> {
        let sought = self.sought(view);
        if sought.is_some() && !self.was_search {
            return sought;
        }
        self.discovery_or_cycle(view).or(sought)
    }

    /// The next request of the search, at the search rate, or with every round while a node that
    /// gets no stop blind is owed one: its motor may be running.
    fn sought<B: Board>(&self, view: View<'_, B>) -> Option<Turn> {
        let is_time = self.search_at.is_none_or(|at| view.now >= at);
        let is_time = is_time || view.nodes.iter().any(|it| it.is_sought_first(view.config));
        is_time.then(|| self.search(view)).flatten()
    }

    /// The next request of the search. Nodes that were heard before and are owed a stop have every
    /// other turn.
    fn search<B: Board>(&self, view: View<'_, B>) -> Option<Turn> {
        let lost = || self.next_for(Reason::SearchLost, self.searched_lost + 1, view, Round::Next);
        let other = || self.next_for(Reason::Search, self.searched + 1, view, Round::Next);
        if self.was_lost { other().or_else(lost) } else { lost().or_else(other) }
    }

    fn discovery_or_cycle<B: Board>(&self, view: View<'_, B>) -> Option<Turn> {
        if self.discovery.is_none() || self.cycle_first > 0 {
            let turn = self.next_for(Reason::Cycle, self.cycle, view, Round::Next);
            if turn.is_some() {
                return turn;
            }
        }
        self.request(self.discovery?.index(), Reason::Discovery, view, Round::Next)
    }

    /// The request for the first node, starting at index `first`, for which this reason is due.
    fn next_for<B: Board>(
        &self,
        reason: Reason,
        first: usize,
        view: View<'_, B>,
        round: Round,
    ) -> Option<Turn> {
        self.next_of(reason, first, view, round, self.served::<B>(reason, round))
    }

    /// The same, but for those that have been `served`, one bit each.
    fn next_of<B: Board>(
        &self,
        reason: Reason,
        first: usize,
        view: View<'_, B>,
        round: Round,
        served: u8,
    ) -> Option<Turn> {
        for step in 0..8 {
            let index = (first + step) & 7;
            if served >> index & 1 == 0 {
                let request = self.request(index, reason, view, round);
                if request.is_some() {
                    return request;
                }
            }
        }
        None
    }

    /// The request for this node, if it is due.
    fn request<B: Board>(
        &self,
        index: usize,
        reason: Reason,
        view: View<'_, B>,
        round: Round,
    ) -> Option<Turn> {
        let node = &view.nodes[index & 7];
        reached(node.due_at(reason, view.config, view.now), view.now).then_some(Turn {
            node: NodeId::ALL[index & 7],
            reason,
            round,
        })
    }

    /// Nodes that have had their turn, one bit each; a regular request is always for the next
    /// round. A stop WRITE is followed by a READ before it is repeated, so it needs no turn of
    /// its own unless it is answered; on a slow line a READ has to be waited for.
    const fn served<B: Board>(&self, reason: Reason, round: Round) -> u8 {
        match (reason, round) {
            (Reason::Repeat, _) if !B::ANSWERS_WRITE => self.had_repeat,
            (_, Round::Next) => 0,
            (Reason::SpeedStop | Reason::Stop, _) if !B::ANSWERS_WRITE => 0,
            (Reason::SetPoint, _) => self.had_set_point,
            // Directly behind its READ.
            (Reason::Hold, _) => 0,
            _ => self.had_stop,
        }
    }

    /// Advances the turns past a request that has been handed out. `exchange` is the time of one
    /// with a node that does not answer.
    pub(super) fn book<B: Board>(
        &mut self,
        turn: Turn,
        is_exchange: bool,
        exchange: Duration,
        config: &MasterConfig,
        now: Instant,
    ) {
        let index = index_of(turn.node);
        self.had_repeat = match turn.reason {
            _ if is_exchange => 0,
            Reason::Repeat => self.had_repeat | 1 << index,
            _ => self.had_repeat,
        };
        // A silent WRITE of the cycle is followed by its READ; only the READ ends the round.
        if turn.round == Round::Next && is_exchange {
            (self.had_stop, self.had_set_point) = (0, 0);
            self.was_search = turn.reason.is_search();
        }
        match turn.reason {
            Reason::SetPoint => {
                self.set_point = index;
                self.had_set_point |= 1 << index;
                if B::ANSWERS_WRITE {
                    // A stop of this node is due in this round, even if it has had one before.
                    self.had_stop &= !(1 << index);
                }
            }
            // The node has yet to be read.
            _ if !is_exchange => {}
            Reason::Discovery => {}
            Reason::SearchLost | Reason::Search => {
                let share = config.recovery_share_pct.clamp(LEAST_SHARE_PCT, 50);
                let whole = exchange.saturating_mul(100).as_micros();
                let pause = whole.checked_div(share.into()).unwrap_or(u32::MAX);
                self.search_at = Some(now + Duration::from_micros(pause));
                self.was_lost = turn.reason == Reason::SearchLost;
                match self.was_lost {
                    true => self.searched_lost = index,
                    false => self.searched = index,
                }
            }
            Reason::Cycle => {
                self.cycle = (index + 1) & 7;
                self.cycle_first = self.cycle_first.saturating_sub(1);
            }
            _ => {
                self.stop = index;
                self.had_stop |= 1 << index;
            }
        }
    }

    /// WRITEs have not left, or nobody knows: each may be repeated before the next exchange.
    pub(super) const fn take_back_writes(&mut self) {
        self.had_repeat = 0;
    }

    /// A request has not left: it is due again. The stops of other nodes go first: it may never
    /// leave whole.
    pub(super) fn take_back(&mut self, turn: Turn) {
        self.take_back_writes();
        if turn.reason.is_search() {
            self.search_at = None;
        }
        if turn.reason.is_stop() {
            self.stop = index_of(turn.node);
        }
    }
}

/// Discovery: polls every id that is not online, and silent ones again.
impl Queue {
    pub(super) const fn is_discovering(&self) -> bool {
        self.discovery.is_some()
    }

    /// Begins a discovery, or joins the one in progress; returns whether it begins.
    pub(super) const fn begin_discovery(&mut self) -> bool {
        let begins = self.discovery.is_none();
        if begins {
            self.discovery = Some(Discovery { step: 0 });
        }
        begins
    }

    /// Advances the discovery past ids that need no request; returns whether that ends it. After
    /// every second one each node first has its turn in the cycle.
    pub(super) fn settle_discovery<B: Board>(
        &mut self,
        nodes: &[Node<B>; 8],
        config: &MasterConfig,
    ) -> bool {
        let Some(mut discovery) = self.discovery else { return false };
        while discovery.pass() < config.attempts.into() {
            let is_here = config.nodes.contains(NodeId::ALL[discovery.index()]);
            if is_here && nodes[discovery.index()].is_scanned(discovery.pass()) {
                self.discovery = Some(discovery);
                return false;
            }
            discovery.step += 1;
        }
        self.discovery = None;
        self.is_second_discovery = !self.is_second_discovery;
        if !self.is_second_discovery {
            self.cycle_first = 8;
        }
        true
    }
}

/// Eight ids, eight nodes; the mask proves it to the compiler.
pub(super) const fn index_of(node: NodeId) -> usize {
    (node.get() as usize - 1) & 7
}
