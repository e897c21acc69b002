//! The queue: which request goes next (I13).
//!
//! A request is either silent or an *exchange*, which is answered. Stops, reads about a mode in
//! doubt and new set-points are urgent. In each round a node has one urgent exchange for a stop and
//! one new set-point. A round ends with one regular exchange, if one is due: for the search for
//! abnormal nodes, a discovery, or the cycle. The search is not due twice in a row unless nothing
//! else is. Reading a position and holding it is one turn: the WRITE directly follows the answer,
//! even where it is an exchange of its own (three motors). So no node can starve the others:
//!
//! * a stop of an online velocity node is sent right after the exchange in progress and at most
//!   seven other stop WRITEs; a stop of a position node is read after at most 16 more exchanges,
//!   with three motors 24, and written next;
//! * a new set-point waits for at most 16 exchanges and 14 other WRITEs, with three motors for 24
//!   exchanges, not counting a stop;
//! * a node in the cycle waits for at most 8 rounds of 17 exchanges, with three motors 25, for as
//!   many rounds of the search, and for two discoveries;
//! * the search waits for one round, even during a discovery.

use super::{
    node::Node,
    role::Master,
    set_point::Confirm,
    turns::{Choice, Reason, Request, Round, Sent},
};
use crate::{
    encode::Encode,
    endpoint::{Endpoint as _, Unsent},
    ikeya::{
        board::{Board, PACKET_LEN, Target},
        units::NodeId,
        wire::ReadRequest,
    },
    stats::{count_apart, uncount},
    time::{Duration, Instant, wire_time},
};

impl<B: Board> Master<B> {
    /// Time at which the next request is due, regardless of the line.
    pub(super) fn due(&self) -> Option<Instant> {
        let mut earliest: Option<Instant> = None;
        for (index, node) in self.nodes.iter().enumerate() {
            for &reason in &Reason::ALL {
                let is_on = match (reason, self.discovery) {
                    (Reason::Discovery, Some(discovery)) => discovery.index() == index,
                    (Reason::Discovery, None) => false,
                    (Reason::Cycle, Some(_)) => self.turns.cycle_first > 0,
                    _ => true,
                };
                if !is_on || !node.wants(reason, &self.config) {
                    continue;
                }
                let mut at = node.earliest(reason).unwrap_or(self.now);
                if reason == Reason::Search {
                    at = self.search.next_at.unwrap_or(at).max(at);
                }
                earliest = Some(earliest.unwrap_or(at).min(at));
            }
        }
        earliest
    }

    /// Chooses the request to send now, if any, regardless of the line.
    fn choose(&self, now: Instant) -> Option<Choice<B>> {
        self.urgent(now, Round::Same)
            .or_else(|| self.regular(now))
            // With no regular request due, the next round begins at once.
            .or_else(|| self.urgent(now, Round::Next))
    }

    /// The next urgent request: for a stop, a mode in doubt or a new set-point.
    fn urgent(&self, now: Instant, round: Round) -> Option<Choice<B>> {
        Reason::ALL[..6].iter().find_map(|&reason| {
            let last = if reason.is_stop() { self.turns.stop } else { self.turns.set_point };
            self.next_for(reason, last + 1, now, round)
        })
    }

    /// The next regular request; it ends the round.
    fn regular(&self, now: Instant) -> Option<Choice<B>> {
        let sought = self.sought(now);
        if sought.is_some() && !self.turns.was_search {
            return sought;
        }
        self.discovery_or_cycle(now).or(sought)
    }

    /// The next request of the search, at the search rate.
    fn sought(&self, now: Instant) -> Option<Choice<B>> {
        let is_time = self.search.next_at.is_none_or(|at| now >= at);
        let first = self.search.last + 1;
        is_time.then(|| self.next_for(Reason::Search, first, now, Round::Next)).flatten()
    }

    fn discovery_or_cycle(&self, now: Instant) -> Option<Choice<B>> {
        let round = Round::Next;
        if self.discovery.is_none() || self.turns.cycle_first > 0 {
            let turn = self.next_for(Reason::Cycle, self.turns.cycle, now, round);
            if turn.is_some() {
                return turn;
            }
        }
        let (index, reason) = (self.discovery?.index(), Reason::Discovery);
        let node = &self.nodes[index];
        let is_due = node.is_due(reason, &self.config, now);
        is_due.then(|| Choice { index, request: node.request(reason), reason, round })
    }

    /// The request for the first node, starting at index `first`, for which this reason is due.
    fn next_for(
        &self,
        reason: Reason,
        first: usize,
        now: Instant,
        round: Round,
    ) -> Option<Choice<B>> {
        for step in 0..8 {
            let index = (first + step) & 7;
            let node = &self.nodes[index];
            let is_next = self.turns.has::<B>(index, reason, round);
            if is_next && node.is_due(reason, &self.config, now) {
                return Some(Choice { index, request: node.request(reason), reason, round });
            }
        }
        None
    }

    /// Hands out the next request, if the line is free for it.
    pub(super) fn send_next(&mut self, now: Instant) -> Option<&[u8]> {
        let is_free = self.line_free.is_none_or(|free| now >= free);
        if !is_free && !self.is_behind_write {
            return None;
        }
        for node in &mut self.nodes {
            if let Some(stop) = &mut node.stop {
                stop.forget_old_hold(now, self.config.turnaround_gap);
            }
        }
        let choice = self.choose(now)?;
        // Right behind a WRITE, send only what cannot pile up: a READ, or one stop per node.
        let is_set_point = !matches!(choice.request, Request::Read) && !choice.reason.is_stop();
        if !is_free && is_set_point {
            return None;
        }
        let len = self.encode(&choice)?;
        let start = self.line_free.map_or(now, |free| free.max(now));
        self.sent = Some(Sent { choice, start, len });
        let request_end = start + wire_time(len, self.config.baud);
        self.line_free = Some(request_end + self.config.turnaround_gap);
        let is_exchange = choice.request.is_exchange();
        self.is_behind_write = !is_exchange && self.config.turnaround_gap == Duration::ZERO;
        self.book(&choice, now);
        if is_exchange {
            self.open_window(NodeId::ALL[choice.index & 7], request_end);
        }
        let packet = self.packet.get(..len)?;
        if self.config.removes_echo {
            self.echo.expect(packet);
        }
        Some(packet)
    }

    /// Encodes the request into the buffer that is handed out; returns its length.
    fn encode(&mut self, choice: &Choice<B>) -> Option<usize> {
        let id = NodeId::ALL[choice.index & 7];
        let buffer = &mut self.packet;
        let bytes = match choice.request {
            Request::Read => ReadRequest::new(id).encode(buffer),
            Request::Write(Target::Velocity(to)) => B::write_velocity(id, to).encode(buffer),
            Request::Write(Target::Position(to)) => B::write_position(id, to).encode(buffer),
        };
        bytes.ok().map(|bytes| bytes.len().min(PACKET_LEN))
    }

    /// Records what has been handed out, and advances the turns.
    fn book(&mut self, choice: &Choice<B>, now: Instant) {
        let Choice { index, request, reason, round } = *choice;
        // A silent WRITE of the cycle is followed by its READ; only the READ ends the round.
        if round == Round::Next && request.is_exchange() {
            (self.turns.had_stop, self.turns.had_set_point) = (0, 0);
            self.turns.was_search = reason == Reason::Search;
        }
        let counter = match request {
            Request::Read => &mut self.statistics.reads,
            Request::Write(_) => &mut self.statistics.writes,
        };
        count_apart(counter);
        let index = index & 7;
        if matches!(request, Request::Write(_)) {
            self.nodes[index].wrote();
        }
        let is_exchange = request.is_exchange();
        match reason {
            Reason::SetPoint => {
                self.turns.set_point = index;
                self.turns.had_set_point |= 1 << index;
            }
            // The node has yet to be read.
            _ if !is_exchange => {}
            Reason::Discovery => {}
            Reason::Search => self.searched(index, now),
            Reason::Cycle => {
                self.turns.cycle = (index + 1) & 7;
                self.turns.cycle_first = self.turns.cycle_first.saturating_sub(1);
            }
            _ => {
                self.turns.stop = index;
                self.turns.had_stop |= 1 << index;
            }
        }
    }

    /// Whether the packet handed out last is a WRITE of a set-point that the node no longer has.
    pub(super) fn has_sent_old_set_point(&self) -> bool {
        let Some(Sent { choice, .. }) = &self.sent else { return false };
        match (choice.reason, choice.request) {
            (Reason::SetPoint | Reason::Cycle, Request::Write(target)) => {
                let node = &self.nodes[choice.index & 7];
                node.set_point.is_none_or(|set_point| set_point.target != target)
            }
            _ => false,
        }
    }

    /// The packet handed out last has not left: its request, or the one that has replaced it, is to
    /// be sent again.
    pub(super) fn take_back(&mut self, unsent: Unsent, now: Instant) {
        if unsent == Unsent::Unflushed {
            // It is unknown which of the latest WRITEs have left: send all of them again, and do
            // not count an answer that comes now for any of them.
            self.nodes.iter_mut().for_each(Node::take_back_write);
            return;
        }
        let Some(Sent { choice, start, len }) = self.sent.take() else { return };
        let Choice { index, request, reason, .. } = choice;
        self.is_behind_write = false;
        if unsent == Unsent::Untouched {
            self.line_free = Some(start);
            self.echo.forget_last();
        } else {
            // Bytes that the port has taken may still be on their way. Leave twice the pause that
            // ends a packet after them: a slave must not take the next packet for the rest of this
            // one.
            let end = start.max(now) + self.wire_time(len);
            let silence = self.frame_pause().saturating_mul(2);
            self.line_free = Some(end + self.config.turnaround_gap + silence);
            self.echo.forget_all();
        }
        let counter = match request {
            Request::Read => &mut self.statistics.reads,
            Request::Write(_) => &mut self.statistics.writes,
        };
        uncount(counter);
        if reason == Reason::Search {
            self.search.next_at = None;
        }
        let is_scan = self.discovery.is_some();
        let is_open = request.is_exchange() && self.window.take().is_some();
        let node = &mut self.nodes[index & 7];
        if matches!(request, Request::Write(_)) {
            node.take_back_write();
        }
        if is_open {
            node.take_back_request(is_scan);
        }
    }
}

impl<B: Board> Node<B> {
    /// The node's request for this reason. A node that is not online gets its stop blind, then a
    /// READ; in the cycle a node gets its set-point, then a READ.
    fn request(&self, reason: Reason) -> Request<B> {
        let target = match reason {
            Reason::StopRead | Reason::Discovery => None,
            Reason::Cycle if self.is_written => None,
            Reason::SetPoint | Reason::Cycle => self.set_point.map(|it| it.target),
            _ => self.stop_write(),
        };
        target.map_or(Request::Read, Request::Write)
    }

    /// Records that its stop or its set-point has been handed out.
    fn wrote(&mut self) {
        self.is_written = true;
        if let Some(stop) = &mut self.stop {
            stop.is_written = true;
            stop.writes = stop.writes.saturating_add(1);
        } else if let Some(set_point) = &mut self.set_point {
            set_point.is_new = false;
            if self.confirm == Confirm::AfterWrite {
                self.confirm = Confirm::AfterAnswer;
            }
        }
    }

    fn take_back_write(&mut self) {
        self.is_written = false;
        if let Some(stop) = &mut self.stop {
            let was_written = core::mem::replace(&mut stop.is_written, false);
            stop.writes = stop.writes.saturating_sub(was_written.into());
        } else if let Some(set_point) = &mut self.set_point {
            set_point.is_new = true;
            if self.confirm == Confirm::AfterAnswer {
                self.confirm = Confirm::AfterWrite;
            }
        }
    }

    fn take_back_request(&mut self, is_scan: bool) {
        uncount(&mut self.statistics.requests);
        if self.attempt > 0 {
            uncount(&mut self.statistics.retries);
        }
        self.scans = self.scans.saturating_sub(is_scan.into());
        self.is_asked = self.is_online();
        let is_lost = !self.is_asked;
        if let Some(stop) = &mut self.stop {
            stop.lost_attempts = stop.lost_attempts.saturating_sub(is_lost.into());
        }
    }
}
