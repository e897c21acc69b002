//! The line: what is on the wire, who may answer until when, and which received bytes are answers
//! (I7).

use super::{
    config::MasterConfig, event::Cause, node::Request, queue::Turn, statistics::MasterStatistics,
};
use crate::{
    encode::Encode,
    endpoint::Unsent,
    ikeya::{
        board::{Board, PACKET_LEN, Status, Target},
        units::NodeId,
        wire::ReadRequest,
    },
    stats::{add, count_apart, uncount},
    stream::{Decoder, Event, Framing},
    time::{Duration, Instant, wire_time},
};

/// Longest time for which the line is kept free for a request that the port holds.
const HELD: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Line<B: Board> {
    /// Time at which the bytes handed out have left and the gap after them is over.
    free_at: Instant,
    packet: [u8; PACKET_LEN],
    /// Whether the last packet was an unanswered WRITE: a READ may follow without a pause.
    is_behind_write: bool,
    /// The open reply window.
    window: Option<Window>,
    decoder: Decoder<B::ToMaster, PACKET_LEN>,
    held: Held,
    /// The request in `packet`.
    sent: Option<Sent<B>>,
    answer_wire_time: Duration,
}

/// A node has been asked and may answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    request_end: Instant,
    pub(super) node: NodeId,
    pub(super) deadline: Instant,
    heard: Heard,
}

/// What has been heard in the window.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Heard {
    Nothing,
    Bytes,
    Others,
}

/// What the port has taken and may still hold, so that its answer is still to come.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Held {
    Nothing,
    /// The last exchange, with this node.
    Last(NodeId),
    /// Earlier ones as well: it is unknown whose answer comes.
    Several,
}

/// The request handed out last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent<B: Board> {
    /// Earliest time at which its first byte could leave.
    start: Instant,
    /// Whether its window is open.
    pub(super) is_open: bool,
    len: usize,
    pub(super) turn: Turn,
    pub(super) request: Request<B>,
}

/// What a response is.
pub(super) enum Response {
    /// The answer to the request that ended at `asked_at`; it came this much later than possible.
    Answer { asked_at: Instant, latency: Duration },
    /// From the node that was asked, but earlier than the line could have carried it.
    Early,
    /// Outside its window, or in another node's.
    Late,
}

/// The requests whose answers are not taken, because the port held them for too long.
pub(super) struct Overdue {
    held: Held,
    /// The window that is closed because of that.
    pub(super) closed: Option<Window>,
    /// Time by which they are answered.
    pub(super) answer_by: Instant,
}

impl Window {
    /// Why it passes without its answer.
    pub(super) const fn cause(&self) -> Cause {
        match self.heard {
            Heard::Nothing => Cause::Silent,
            Heard::Bytes => Cause::Damaged,
            Heard::Others => Cause::Unexpected,
        }
    }
}

impl Overdue {
    /// Whether this node may have been asked in one of them.
    pub(super) fn concerns(&self, node: NodeId) -> bool {
        self.held == Held::Several || self.held == Held::Last(node)
    }
}

impl<B: Board> Line<B> {
    pub(super) fn new(config: &MasterConfig, now: Instant) -> Self {
        Self {
            is_behind_write: false,
            held: Held::Nothing,
            free_at: now,
            window: None,
            answer_wire_time: wire_time(<B::ToMaster as Framing>::MAX_LEN, config.baud),
            packet: [0; PACKET_LEN],
            sent: None,
            decoder: Decoder::new(),
        }
    }

    pub(super) const fn decoder(&self) -> &Decoder<B::ToMaster, PACKET_LEN> {
        &self.decoder
    }

    /// Time from handing out a READ to the end of its window.
    pub(super) fn window_time(&self, config: &MasterConfig) -> Duration {
        wire_time(ReadRequest::LEN, config.baud) + self.answer_time(config)
    }

    /// Time of a WRITE, which is as long as an answer, and of the gap in front of it.
    pub(super) fn write_time(&self, config: &MasterConfig) -> Duration {
        self.answer_wire_time + config.turnaround_gap
    }

    /// Time from the end of a request to the end of its window.
    fn answer_time(&self, config: &MasterConfig) -> Duration {
        config.reply_timeout + self.answer_wire_time
    }

    /// Time of the next thing to do, if requests are due at `due`.
    pub(super) fn next_at(&self, due: impl FnOnce() -> Option<Instant>) -> Option<Instant> {
        match &self.window {
            Some(window) => Some(window.deadline),
            // Not before the line is free.
            None => due().map(|due| due.max(self.free_at)),
        }
    }
}

/// Requests.
impl<B: Board> Line<B> {
    /// Whether an answer is waited for.
    pub(super) const fn is_waiting(&self) -> bool {
        self.window.is_some()
    }

    fn is_free(&self, now: Instant) -> bool {
        now >= self.free_at
    }

    /// Whether any request may be sent now.
    pub(super) fn is_ready(&self, now: Instant) -> bool {
        self.is_free(now) || self.is_behind_write
    }

    /// Whether this one may. Right behind a WRITE: only what cannot pile up, a READ, or one stop
    /// for each node.
    pub(super) fn takes(&self, turn: Turn, request: &Request<B>, now: Instant) -> bool {
        let is_set_point = !matches!(request, Request::Read) && !turn.reason.is_stop();
        self.is_free(now) || !is_set_point
    }

    /// Hands out a request; an exchange opens its window, and drops the bytes received before.
    pub(super) fn send(
        &mut self,
        turn: Turn,
        request: Request<B>,
        config: &MasterConfig,
        statistics: &mut MasterStatistics,
        now: Instant,
    ) -> Option<()> {
        let len = self.encode(turn.node, &request)?;
        let start = self.free_at.max(now);
        let is_open = request.is_exchange();
        self.sent = Some(Sent { turn, request, is_open, start, len });
        let request_end = start + wire_time(len, config.baud);
        self.free_at = request_end + config.turnaround_gap;
        self.is_behind_write = !is_open && config.turnaround_gap == Duration::ZERO;
        count_apart(counter(&request, statistics));
        if is_open {
            self.drop_stale_bytes(statistics);
            let deadline = request_end + self.answer_time(config);
            let (node, heard) = (turn.node, Heard::Nothing);
            self.window = Some(Window { node, request_end, deadline, heard });
            if self.held != Held::Nothing {
                self.held = Held::Several;
            }
        }
        Some(())
    }

    /// The packet handed out last.
    pub(super) fn packet(&self) -> Option<&[u8]> {
        self.packet.get(..self.sent.as_ref()?.len)
    }

    /// The request handed out last, unless it was taken back.
    pub(super) const fn sent(&self) -> Option<&Sent<B>> {
        self.sent.as_ref()
    }

    /// Encodes the request into the buffer that is handed out; returns its length.
    fn encode(&mut self, id: NodeId, request: &Request<B>) -> Option<usize> {
        let buffer = &mut self.packet;
        let bytes = match *request {
            Request::Read => ReadRequest::new(id).encode(buffer),
            Request::Write(Target::Velocity(to)) => B::write_velocity(id, to).encode(buffer),
            Request::Write(Target::Position(to)) => B::write_position(id, to).encode(buffer),
        };
        bytes.ok().map(|bytes| bytes.len().min(PACKET_LEN))
    }

    fn drop_stale_bytes(&mut self, statistics: &mut MasterStatistics) {
        let stale = self.decoder.pending();
        add(&mut statistics.stale_bytes, stale as u32);
        while self.decoder.pending() > 0 {
            self.decoder.idle();
            while self.decoder.decode_buffered(&mut [].as_slice()).is_some() {}
        }
    }

    /// The packet handed out last has not left, or not whole; `silence` is needed behind a part of
    /// it. Returns its request, with whether its window was open.
    pub(super) fn take_back(
        &mut self,
        unsent: Unsent,
        config: &MasterConfig,
        statistics: &mut MasterStatistics,
        now: Instant,
    ) -> Option<Sent<B>> {
        let mut sent = self.sent.take()?;
        self.is_behind_write = false;
        if unsent == Unsent::Untouched {
            self.free_at = sent.start;
        } else {
            // Bytes that the port has taken may still be on their way. Leave twice the pause that
            // ends a packet after them: a slave must not take the next packet for the rest of this
            // one.
            let end = sent.start.max(now) + wire_time(sent.len, config.baud);
            self.free_at = end + config.turnaround_gap + silence(config);
        }
        uncount(counter(&sent.request, statistics));
        sent.is_open = sent.is_open && self.window.take().is_some();
        Some(sent)
    }

    /// A part of a packet may leave until `end`: a silence must follow, and another one behind the
    /// next flush.
    pub(super) fn cut_off(&mut self, config: &MasterConfig, end: Instant) {
        self.sent = None;
        self.free_at = self.free_at.max(end + silence(config));
        self.is_behind_write = false;
    }

    /// The port has taken the packet, and may hold it. Behind a request, the next one waits for the
    /// flush; behind a silent WRITE, only for the gap.
    pub(super) fn hold(&mut self, config: &MasterConfig, now: Instant) {
        match (&self.window, self.held, &self.sent) {
            (Some(window), Held::Nothing, _) => {
                self.held = Held::Last(window.node);
                self.free_at = now + HELD;
            }
            (None, _, Some(sent)) if config.turnaround_gap > Duration::ZERO => {
                // Its bytes and the gap begin now.
                self.free_at = self.free_at.max(now + (self.free_at - sent.start));
            }
            _ => {}
        }
    }

    /// What the port has held has left, at the latest by now. Returns what is overdue.
    pub(super) fn flushed(&mut self, left_by: Instant, config: &MasterConfig) -> Option<Overdue> {
        if self.sent.is_none() {
            // A part of the packet that was taken back may be among it.
            self.cut_off(config, left_by);
        }
        let held = core::mem::replace(&mut self.held, Held::Nothing);
        let answer_by = left_by + self.answer_time(config);
        let is_open = self.window.as_ref().is_some_and(|window| left_by <= window.deadline);
        match (&mut self.window, held) {
            (_, Held::Nothing) => None,
            (Some(window), Held::Last(_)) if is_open => {
                window.deadline = window.deadline.max(answer_by);
                self.free_at = window.request_end.max(left_by) + config.turnaround_gap;
                None
            }
            _ => {
                // The answer comes too late, or may be that of an earlier request.
                self.free_at = answer_by.max(left_by + config.turnaround_gap);
                self.is_behind_write = false;
                Some(Overdue { held, closed: self.window.take(), answer_by })
            }
        }
    }
}

/// Longest pause inside a packet: as long as a slave on a UART waits for its rest.
pub(super) fn frame_pause(config: &MasterConfig) -> Duration {
    wire_time(5, config.baud)
}

/// Silence behind a part of a packet. Nodes that may answer late, such as those of a PC, also wait
/// longer for the rest of a packet: at most 20 ms, as with `SlaveConfig::usb_adapter`.
fn silence(config: &MasterConfig) -> Duration {
    let late = config.reply_timeout.min(Duration::from_millis(20));
    frame_pause(config).saturating_mul(2) + late
}

fn counter<'a, B: Board>(
    request: &Request<B>,
    statistics: &'a mut MasterStatistics,
) -> &'a mut u32 {
    match request {
        Request::Read => &mut statistics.reads,
        Request::Write(_) => &mut statistics.writes,
    }
}

/// Replies.
impl<B: Board> Line<B> {
    /// Notes received bytes, for the cause if the window passes without an answer.
    pub(super) fn note(&mut self, bytes: &[u8]) {
        if let Some(window) = self.window.as_mut().filter(|_| !bytes.is_empty()) {
            if window.heard == Heard::Nothing {
                window.heard = Heard::Bytes;
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

    /// Judges a response of this node; the answer closes its window.
    pub(super) fn judge(&mut self, id: NodeId, config: &MasterConfig, now: Instant) -> Response {
        let half_answer = Duration::from_micros(self.answer_wire_time.as_micros() / 2);
        match &mut self.window {
            Some(window)
                if window.node == id && now <= window.deadline && self.held != Held::Several =>
            {
                // No line is that fast, even allowing for a slightly coarse clock.
                if now < window.request_end + half_answer && !config.accepts_early {
                    window.heard = Heard::Others;
                    return Response::Early;
                }
                let asked_at = window.request_end;
                let latency = now - (asked_at + self.answer_wire_time);
                (self.window, self.held) = (None, Held::Nothing);
                self.free_at = now + config.turnaround_gap;
                Response::Answer { asked_at, latency }
            }
            window => {
                if let Some(window) = window {
                    window.heard = Heard::Others;
                }
                Response::Late
            }
        }
    }

    /// Puts a window aside that opened after `since`: bytes that may be older are no answer.
    pub(super) fn set_window_aside(&mut self, since: Instant) -> Option<Window> {
        self.window.take_if(|window| since < window.request_end)
    }

    /// Puts it back, behind old bytes if there were any.
    pub(super) const fn put_window_back(&mut self, window: Option<Window>, is_behind_bytes: bool) {
        if let Some(mut window) = window {
            if is_behind_bytes {
                window.heard = Heard::Others;
            }
            self.window = Some(window);
        }
    }

    /// Closes a window that has passed without its answer.
    pub(super) fn expire_window(&mut self, now: Instant) -> Option<Window> {
        self.window.take_if(|window| now >= window.deadline)
    }
}
