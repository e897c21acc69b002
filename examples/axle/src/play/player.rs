//! Sends frames at their times, and lists what is sent and received.

use std::{
    collections::VecDeque,
    time::{SystemTime, UNIX_EPOCH},
};

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{Mode, NodeId, VelocityResponse, master::NodeSet, three},
    time::{Duration, Instant, wire_time},
    ucp::{Body, MotorControl},
};

use super::effect::Effect;
use crate::{
    args::Protocol,
    decode::{self, Sheet, Stream},
    failure::Failure,
    listing::{Modes, Style},
    pcapng::Direction,
    signals::Attendance,
};

/// A frame and when to send it.
#[derive(Clone, Debug)]
pub(crate) struct Due {
    /// After the beginning, microseconds.
    pub(crate) after_us: u64,
    pub(crate) bytes: Box<[u8]>,
    /// For a WRITE, the mode that it was meant for, if that is known.
    pub(crate) meant: Option<Mode>,
    pub(crate) effect: Effect,
}

/// Interval between the stops on a rover's line before its first motor command (ruling U16).
const STOP_PERIOD: Duration = Duration::from_millis(100);

/// Pause between a frame and its answer (ruling I9 asks for 50 us at least).
const TURNAROUND: Duration = Duration::from_micros(200);

/// Number of READs in a row without an answer, and the time since the first of them, after which no
/// more commands are sent: a USB adapter may delay an answer by 16 ms.
const QUESTIONS: u32 = 3;
const SILENCE: Duration = Duration::from_millis(100);

/// A role that sends given frames.
pub(crate) struct Player {
    protocol: Protocol,
    due: VecDeque<Due>,
    start: Instant,
    /// Line speed, bit/s.
    baud: u32,
    /// Sent bytes that the line will echo, if it does.
    echo: Option<VecDeque<u8>>,
    /// How long to listen after the last frame, microseconds.
    linger_us: u64,
    last_at: Instant,
    /// When the line has carried all that was handed out, and the answers to it.
    is_free_at: Instant,
    /// When the next stop is due, until a frame commands the motors of a rover.
    stop_at: Option<Instant>,
    /// The frame handed out last.
    sending: Box<[u8]>,
    attendance: Attendance,
    /// Why sending has ended.
    failure: Option<Failure>,
    /// The nodes that are commanded.
    commanded: NodeSet,
    /// Number of questions to them since the last answer on the line, and when the first of them
    /// left.
    unanswered: (u32, Instant),
    sheet: Sheet,
    sent: Box<dyn Stream>,
    received: Box<dyn Stream>,
    /// The system's time at the start, microseconds since 1970.
    epoch_us: u64,
    /// The modes in which the commands were meant.
    modes: Modes,
    /// Frames that did not leave whole. They are not sent again: they would come late.
    pub(crate) lost: usize,
}

/// Settings of a player.
pub(crate) struct Part {
    pub(crate) protocol: Protocol,
    pub(crate) baud: u32,
    pub(crate) due: VecDeque<Due>,
    pub(crate) linger_us: u64,
    /// Whether a rover on this line must be kept from moving on: vendor robots drive while any
    /// byte arrives.
    pub(crate) holds_rover: bool,
    /// Whether the line hears what it sends.
    pub(crate) has_echo: bool,
    /// The modes in which the commands are meant.
    pub(crate) modes: Modes,
}

impl Player {
    pub(crate) fn new(part: Part, style: Style, now: Instant) -> Self {
        let Part { protocol, baud, due, linger_us, holds_rover, has_echo, modes } = part;
        let written = |due: &Due| match &due.effect {
            Effect::Write(write) => Some(write.node),
            _ => None,
        };
        let commanded = due.iter().filter_map(written).collect();
        let mut sheet = Sheet::new(Some(style));
        style.titles(&mut sheet.out);
        sheet.modes = modes;
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            protocol,
            due,
            start: now,
            baud,
            echo: has_echo.then(VecDeque::new),
            linger_us,
            last_at: now,
            is_free_at: now,
            stop_at: holds_rover.then_some(now),
            sending: Box::default(),
            attendance: Attendance::new(now),
            failure: None,
            commanded,
            unanswered: (0, now),
            sheet,
            sent: decode::stream_of(protocol, Direction::Out),
            received: decode::stream_of(protocol, Direction::In),
            epoch_us: epoch.map_or(0, |since| since.as_micros() as u64),
            modes,
            lost: 0,
        }
    }

    /// Number of frames that were not handed out.
    pub(crate) fn left(&self) -> usize {
        self.due.len()
    }

    /// Fails if the tool did not run for a while, so that what was due meanwhile is out of date, or
    /// if the nodes that are commanded do not answer any more. Nothing more is sent then. Call it
    /// in every round.
    pub(crate) fn check(&mut self, now: Instant) -> Result<(), Failure> {
        self.attend(now);
        self.failure.take().map_or(Ok(()), Err)
    }

    fn attend(&mut self, now: Instant) {
        if let Err(failure) = self.attendance.check(now) {
            self.failure.get_or_insert(failure);
        }
        let (asked, since) = self.unanswered;
        if asked >= QUESTIONS && now - since >= SILENCE {
            let line = format!("no answer to {QUESTIONS} READs: no more commands are sent");
            self.failure.get_or_insert(Failure::Failed(line));
        }
    }

    /// Whether everything was sent, and the time to listen is over.
    pub(crate) fn is_over(&self, now: Instant) -> bool {
        self.due.is_empty() && now.as_micros() >= self.last_at.as_micros() + self.linger_us
    }

    /// The modes in which the nodes have answered last.
    pub(crate) const fn seen(&self) -> Modes {
        self.sheet.modes
    }

    /// A node that has answered in another mode than its commands are meant for, and both modes.
    pub(crate) fn turncoat(&self) -> Option<(NodeId, Mode, Mode)> {
        NodeId::ALL.into_iter().find_map(|node| {
            let (meant, now) = (self.modes.of(node)?, self.sheet.modes.of(node)?);
            (meant != now).then_some((node, now, meant))
        })
    }

    /// Lists what is held back, at the end.
    pub(crate) fn finish(&mut self) -> Option<String> {
        self.received.finish(&mut self.sheet);
        self.sent.finish(&mut self.sheet);
        self.poll_event()
    }

    /// Length of the answer to a frame with this effect, bytes; boards with three motors answer
    /// commands too (ruling I10).
    const fn answer_len(&self, effect: &Effect) -> usize {
        match (self.protocol, effect) {
            (Protocol::Ikeya, Effect::Ask(_)) => size_of::<VelocityResponse>(),
            (Protocol::Ikeya3, Effect::Ask(_) | Effect::Write(_)) => {
                size_of::<three::VelocityResponse>()
            }
            _ => 0,
        }
    }

    fn time_of(&self, due: &Due) -> Instant {
        Instant::from_micros(self.start.as_micros() + due.after_us)
    }

    fn micros(&self, now: Instant) -> Option<u64> {
        Some(self.epoch_us + now.as_micros().saturating_sub(self.start.as_micros()))
    }
}

impl Endpoint for Player {
    /// Finished lines.
    type Event = String;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        let mut bytes = bytes;
        if let Some(echo) = &mut self.echo {
            let same = echo.iter().zip(bytes).take_while(|(sent, heard)| sent == heard).count();
            echo.drain(..same);
            bytes = bytes.get(same..).unwrap_or_default();
            if !bytes.is_empty() {
                // Damaged, or other bytes came first: the rest is shown unchanged.
                echo.clear();
            }
        }
        if !bytes.is_empty() {
            let (micros, before) = (self.micros(now), self.received.counters().frames);
            self.received.feed(bytes, micros, &mut self.sheet);
            if self.received.counters().frames > before {
                self.unanswered = (0, now);
            }
        }
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn wire_time(&self, bytes: usize) -> Duration {
        wire_time(bytes, self.baud)
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.attend(now);
        if self.failure.is_some() || now < self.poll_timeout()? {
            return None;
        }
        let due = self.due.front().filter(|due| now >= self.time_of(due));
        let is_motor = due.is_some_and(|due| due.effect.is_for_wheels());
        let mut answer = 0;
        if !is_motor && self.stop_at.is_some_and(|at| now >= at) {
            self.stop_at = Some(now + STOP_PERIOD);
            self.sending = MotorControl::STOP.frame(0).as_bytes().into();
        } else {
            let due = self.due.pop_front()?;
            if is_motor {
                self.stop_at = None;
            }
            answer = self.answer_len(&due.effect);
            if let Effect::Ask(node) = due.effect
                && self.commanded.contains(node)
            {
                let (asked, since) = self.unanswered;
                self.unanswered = (asked + 1, if asked == 0 { now } else { since });
            }
            (self.sending, self.last_at) = (due.bytes, now);
        }
        if let Some(echo) = &mut self.echo {
            echo.extend(&self.sending);
        }
        let turnaround = if answer > 0 { TURNAROUND } else { Duration::ZERO };
        self.is_free_at = now + self.wire_time(self.sending.len() + answer) + turnaround;
        let micros = self.micros(now);
        self.sent.feed(&self.sending, micros, &mut self.sheet);
        Some(&self.sending)
    }

    fn handle_unsent(&mut self, _: Unsent, _: Instant) {
        self.lost += 1;
        // An unknown part of it is echoed.
        self.echo.iter_mut().for_each(VecDeque::clear);
    }

    fn poll_event(&mut self) -> Option<String> {
        if self.sheet.out.0.is_empty() {
            return None;
        }
        let lines = String::from_utf8_lossy(&self.sheet.out.0).trim_end().to_owned();
        self.sheet.out.0.clear();
        Some(lines)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let next = self.time_of(self.due.front()?);
        let next = self.stop_at.map_or(next, |at| at.min(next));
        Some(next.max(self.is_free_at))
    }
}

#[cfg(test)]
mod tests;
