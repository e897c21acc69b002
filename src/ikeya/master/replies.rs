//! Replies: which ones are accepted, and their effects (I7).

use super::{
    event::MasterEvent,
    health::Health,
    mode::Decision,
    role::{Master, index_of},
    set_point::{Confirm, SetPoint},
    stop::Standstill,
    window::{Heard, Held, Window},
};
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::NodeId,
        wire::ReadRequest,
    },
    stats::{add, count_apart},
    stream::Event,
    time::{Duration, Instant, wire_time},
};

/// Longest time for which the line is kept free for a request that the port holds.
const HELD: Duration = Duration::from_millis(1000);

impl<B: Board> Master<B> {
    /// Time from handing out a READ to the end of its window.
    pub(super) fn window_time(&self) -> Duration {
        wire_time(ReadRequest::LEN, self.config.baud) + self.answer_time()
    }

    /// Time from the end of a request to the end of its window.
    fn answer_time(&self) -> Duration {
        self.config.reply_timeout + self.answer_wire_time
    }

    /// Opens the window of a request, and drops the bytes received before it.
    pub(super) fn open_window(&mut self, node: NodeId, request_end: Instant) {
        let stale = self.decoder.pending();
        add(&mut self.statistics.stale_bytes, stale as u32);
        while self.decoder.pending() > 0 {
            self.decoder.idle();
            while self.decoder.decode_buffered(&mut [].as_slice()).is_some() {}
        }
        let is_scan = self.discovery.is_some();
        let asked = &mut self.nodes[index_of(node)];
        asked.sent_request(&self.config, self.now);
        asked.scans = asked.scans.saturating_add(is_scan.into());
        let deadline = request_end + self.answer_time();
        self.window = Some(Window { node, request_end, deadline, heard: Heard::Nothing });
        if self.held != Held::Nothing {
            self.held = Held::Several;
        }
    }

    /// The port has taken a request, and may hold it: the next one waits for its flush.
    pub(super) fn hold_line(&mut self, now: Instant) {
        if let (Some(window), Held::Nothing) = (&self.window, self.held) {
            self.held = Held::Last(window.node);
            self.line_free = Some(now + HELD);
        }
    }

    /// What the port has held has left, at the latest by now.
    pub(super) fn expect_answer(&mut self, left_by: Instant) {
        let held = core::mem::replace(&mut self.held, Held::Nothing);
        let answer_by = left_by + self.answer_time();
        let is_open = self.window.as_ref().is_some_and(|window| left_by <= window.deadline);
        match (&mut self.window, held) {
            (_, Held::Nothing) => {}
            (Some(window), Held::Last(_)) if is_open => {
                window.deadline = window.deadline.max(answer_by);
                let gap = self.config.turnaround_gap;
                self.line_free = Some(window.request_end.max(left_by) + gap);
            }
            _ => {
                // The answer comes too late, or may be that of an earlier request.
                self.close_window();
                let guarded_until = Some(answer_by + self.config.late_guard);
                for id in NodeId::ALL {
                    if held == Held::Several || held == Held::Last(id) {
                        self.node_mut(id).guarded_until = guarded_until;
                    }
                }
                self.line_free = Some(answer_by);
                self.is_behind_write = false;
            }
        }
    }

    /// The next complete response in the input.
    pub(super) fn next_response(&mut self, bytes: &mut &[u8]) -> Option<(NodeId, Status<B>)> {
        loop {
            match self.decoder.decode_buffered(bytes)? {
                Event::Frame(frame) => return Some(B::response(frame)),
                Event::Skipped(_) => {}
            }
        }
    }

    /// Handles a response. Only here is it decided whether it is an answer.
    pub(super) fn hear(&mut self, id: NodeId, status: Status<B>, now: Instant) {
        let half_answer = Duration::from_micros(self.answer_wire_time.as_micros() / 2);
        let accepts_early = self.config.accepts_early;
        let statistics = &mut self.nodes[index_of(id)].statistics;
        match &mut self.window {
            Some(window)
                if window.node == id && now <= window.deadline && self.held != Held::Several =>
            {
                // No line is that fast, even allowing for a slightly coarse clock.
                if now < window.request_end + half_answer && !accepts_early {
                    window.heard = Heard::Others;
                    count_apart(&mut statistics.early);
                    return self.hear_mode_outside_window(id, status.mode());
                }
                let request_end = window.request_end;
                (self.window, self.held) = (None, Held::Nothing);
                self.line_free = Some(now + self.config.turnaround_gap);
                self.hear_answer(id, status, request_end, now);
                self.settle_discovery();
            }
            window => {
                if let Some(window) = window {
                    window.heard = Heard::Others;
                }
                count_apart(&mut statistics.late);
                self.hear_mode_outside_window(id, status.mode());
            }
        }
    }

    /// Handles an answer in its window.
    fn hear_answer(&mut self, id: NodeId, status: Status<B>, request_end: Instant, now: Instant) {
        let latency = now - (request_end + self.answer_wire_time);
        let mode = status.mode();
        let node = self.node_mut(id);
        let was = node.health.replace(Health::Online);
        (node.strikes, node.attempt, node.guarded_until) = (0, 0, None);
        let decision = node.decide(mode);
        match was {
            None => self.tell(MasterEvent::Discovered { node: id, mode }),
            Some(Health::Online) => {}
            Some(_) => self.tell(MasterEvent::Health { node: id, health: Health::Online }),
        }
        match decision {
            Decision::Agreed => {}
            Decision::Doubtful => return self.hear_doubtful(id, &status),
            Decision::Settled | Decision::Changed => self.end_doubt(id, mode, decision),
        }
        let node = self.node_mut(id);
        node.statistics.reply(latency);
        node.has_answered = true;
        node.status = Some((status, now));
        self.events.push_frequent(MasterEvent::Status { node: id, status });
        let node = self.node_mut(id);
        if node.confirm == Confirm::AfterAnswer {
            node.confirm = Confirm::Unasked;
            self.tell(MasterEvent::Confirmed { node: id });
        }
        self.pay_stop(id, status, now);
    }

    /// Handles a good answer in the node's mode: it may measure or pay a stop, or show a
    /// standstill.
    fn pay_stop(&mut self, id: NodeId, status: Status<B>, now: Instant) {
        let node = self.node_mut(id);
        if let Some(stop) = &mut node.stop {
            stop.measure(&status, now);
            if !stop.pay() {
                return;
            }
            // A position stop is not written until there is a position to hold.
            let target = match (status, stop.hold) {
                (Status::Position(_), Some(hold)) => Target::Position(hold),
                _ => Target::STANDSTILL,
            };
            node.stop = None;
            node.set_point = Some(SetPoint::of_stop(target));
            node.standstill = Standstill::Watched(None);
            self.tell(MasterEvent::Stopped { node: id });
        }
        if self.node_mut(id).standstill.watch(status, now) {
            self.tell(MasterEvent::StandingStill { node: id });
        }
    }

    /// Closes a window that has passed without its answer.
    pub(super) fn expire_window(&mut self, now: Instant) {
        if self.window.as_ref().is_some_and(|window| now >= window.deadline) {
            self.close_window();
        }
    }

    /// Closes the window without its answer.
    fn close_window(&mut self) {
        if let Some(window) = self.window.take() {
            self.strike(window.node, window.cause(), window.deadline);
            self.settle_discovery();
        }
    }
}
