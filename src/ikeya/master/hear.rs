//! Windows, and what is heard in them.

use super::{
    Board, Cause, Discovery, Health, Heard, Master, MasterEvent, NodeId, ReadRequest, STRIKES,
    State, Status, node::Confirm,
};
use crate::{
    ikeya::Mode,
    stream::{Event, Framing},
    time::{Duration, Instant, wire_time},
};

impl<B: Board> Master<B> {
    /// From handing out a READ to the end of its window.
    pub(super) fn window(&self) -> Duration {
        self.answer_time(wire_time(ReadRequest::LEN, self.config.baud))
    }

    /// `request` and the time that its answer may take.
    fn answer_time(&self, request: Duration) -> Duration {
        request + self.config.reply_timeout + self.answer_wire_time()
    }

    fn answer_wire_time(&self) -> Duration {
        wire_time(<B::ToMaster as Framing>::MAX_LEN, self.config.baud)
    }

    /// Opens the window of a request, and drops what was left on the line before it (I7).
    pub(super) fn open(&mut self, node: NodeId, request_end: Instant) {
        let stale = self.decoder.pending();
        self.statistics.stale_bytes = self.statistics.stale_bytes.wrapping_add(stale as u32);
        while self.decoder.pending() > 0 {
            self.decoder.idle();
            while self.decoder.decode(&mut [].as_slice()).is_some() {}
        }
        let is_scan = self.discovery.is_some();
        for node in &mut self.nodes {
            node.jumped = false;
        }
        let (config, now) = (self.config, self.now);
        let asked = self.node_mut(node);
        asked.sent_read(&config, now);
        asked.scans = asked.scans.saturating_add(is_scan.into());
        let deadline = request_end + self.answer_time(Duration::ZERO);
        self.state = State::Awaiting { node, request_end, deadline, heard: Heard::Nothing };
    }

    /// The next whole response in the input.
    pub(super) fn next_response(&mut self, bytes: &mut &[u8]) -> Option<(NodeId, Status<B>)> {
        loop {
            match self.decoder.decode(bytes)? {
                Event::Frame(frame) => return Some(B::response(frame)),
                Event::Skipped(_) => {}
            }
        }
    }

    /// A node has spoken. Whether that is an answer is decided here and nowhere else.
    pub(super) fn hear(&mut self, id: NodeId, status: Status<B>, now: Instant) {
        match &mut self.state {
            State::Awaiting { node, deadline, request_end, .. }
                if *node == id && now <= *deadline =>
            {
                let request_end = *request_end;
                self.state = State::Idle;
                self.line_free = Some(now + self.config.turnaround_gap);
                if self.is_believed(id, status.mode()) {
                    self.accept(id, status, request_end, now);
                }
                self.settle_discovery();
            }
            state => {
                if let State::Awaiting { heard, .. } = state {
                    *heard = Heard::Others;
                }
                let late = &mut self.node_mut(id).statistics.late;
                *late = late.wrapping_add(1);
            }
        }
    }

    /// An answer in another mode than the node's is believed the second time in a row.
    fn is_believed(&mut self, id: NodeId, mode: Mode) -> bool {
        let node = self.node_mut(id);
        let is_other = node.mode.is_some_and(|known| known != mode);
        if is_other && !node.other_mode {
            node.other_mode = true;
            node.asked = true;
            node.statistics.other_mode = node.statistics.other_mode.wrapping_add(1);
            return false;
        }
        node.other_mode = false;
        true
    }

    /// Takes an answer.
    fn accept(&mut self, id: NodeId, status: Status<B>, request_end: Instant, now: Instant) {
        let latency = now - (request_end + self.answer_wire_time());
        let mode = status.mode();
        let node = self.node_mut(id);
        let (was, was_mode) = (node.health, node.mode);
        node.statistics.reply(latency);
        (node.health, node.mode, node.status) =
            (Some(Health::Online), Some(mode), Some((status, now)));
        (node.strikes, node.attempt, node.guarded_until) = (0, 0, None);
        let is_confirmed = node.confirm == Confirm::AfterRead;
        if is_confirmed {
            node.confirm = Confirm::Unasked;
        }
        let is_changed = was_mode.is_some_and(|was| was != mode);
        if is_changed {
            node.forget_target();
        }
        match was {
            None => self.tell(MasterEvent::Discovered { node: id, mode }),
            Some(Health::Online) => {}
            Some(_) => self.tell(MasterEvent::Health { node: id, health: Health::Online }),
        }
        if is_changed {
            self.tell(MasterEvent::ModeChanged { node: id, mode });
        }
        self.tell(MasterEvent::Status { node: id, status });
        if is_confirmed {
            self.tell(MasterEvent::Confirmed { node: id });
        }
    }

    /// A window has closed without its answer.
    pub(super) fn strike(&mut self, id: NodeId, cause: Cause, deadline: Instant) {
        let (attempts, guard) = (self.config.attempts.max(1), self.config.late_guard);
        let node = self.node_mut(id);
        node.guarded_until = Some(deadline + guard);
        node.statistics.timeouts = node.statistics.timeouts.wrapping_add(1);
        if cause == Cause::Damaged {
            node.statistics.crc_errors = node.statistics.crc_errors.wrapping_add(1);
        }
        if !node.is_online() {
            return; // looked for, and not found
        }
        node.strikes = node.strikes.saturating_add(1);
        node.attempt = node.attempt.saturating_add(1);
        let is_abnormal = node.strikes >= STRIKES;
        let is_failed = is_abnormal || node.attempt >= attempts;
        let health = if is_abnormal { Health::Abnormal } else { Health::Suspect(node.strikes) };
        node.health = Some(health);
        if is_abnormal && !(node.is_stop && node.fresh) {
            node.forget_target();
        }
        let confirm = node.confirm;
        if is_failed {
            node.attempt = 0;
            node.confirm = Confirm::Unasked;
        }
        self.tell(MasterEvent::Health { node: id, health });
        if is_failed {
            self.tell(MasterEvent::ReadFailed { node: id, cause });
            if confirm != Confirm::Unasked {
                self.tell(MasterEvent::NotConfirmed { node: id, cause });
            }
        }
    }

    /// Moves a discovery past the ids that need not be asked, and ends it behind the last.
    pub(super) fn settle_discovery(&mut self) {
        let Some(mut discovery) = self.discovery else { return };
        while discovery.pass < self.config.attempts.max(1) {
            match self.nodes.get(discovery.next) {
                None => discovery = Discovery { pass: discovery.pass + 1, next: 0 },
                // Asked in this pass, or found.
                Some(node) if node.is_online() || node.scans > discovery.pass => {
                    discovery.next += 1
                }
                Some(_) => {
                    self.discovery = Some(discovery);
                    return;
                }
            }
        }
        self.discovery = None;
        let online = self.nodes.iter().filter(|node| node.is_online()).count();
        self.tell(MasterEvent::DiscoveryDone { online: online as u8 });
    }

    /// The input behind the bytes that are our own.
    pub(super) fn without_echo<'b>(&mut self, mut bytes: &'b [u8]) -> &'b [u8] {
        while let (Some(own), [first, rest @ ..]) = (self.echo.front(), bytes) {
            if own != first {
                self.statistics.echo_errors = self.statistics.echo_errors.wrapping_add(1);
                self.echo.clear();
                break;
            }
            self.statistics.echo_bytes = self.statistics.echo_bytes.wrapping_add(1);
            self.echo.pop_front();
            bytes = rest;
        }
        bytes
    }
}
