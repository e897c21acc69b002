//! Sends frames at their times, and lists what is sent and received.

use std::{
    collections::VecDeque,
    time::{SystemTime, UNIX_EPOCH},
};

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{Mode, NodeId},
    time::Instant,
};

use crate::{
    args::Protocol,
    decode::{self, Sheet, Stream},
    listing::{Modes, Style},
    pcapng::Direction,
};

/// A frame and when to send it.
#[derive(Clone, Debug)]
pub(crate) struct Due {
    /// After the beginning, microseconds.
    pub(crate) after_us: u64,
    pub(crate) bytes: Box<[u8]>,
    /// For a WRITE, the mode that it was meant for, if that is known.
    pub(crate) meant: Option<Mode>,
}

/// A role that says what it is told to.
pub(crate) struct Player {
    due: VecDeque<Due>,
    start: Instant,
    /// How long to listen behind the last frame, microseconds.
    linger_us: u64,
    last_at: Instant,
    /// The frame handed out last.
    sending: Box<[u8]>,
    sheet: Sheet,
    sent: Box<dyn Stream>,
    received: Box<dyn Stream>,
    /// The system's time at the start, microseconds since 1970.
    epoch_us: u64,
    /// The modes in which the commands were meant.
    modes: Modes,
    pub(crate) frames: u64,
    /// Frames that did not leave whole. They are not sent again: they would come late.
    pub(crate) lost: u64,
}

impl Player {
    pub(crate) fn new(
        protocol: Protocol,
        due: VecDeque<Due>,
        linger_us: u64,
        style: Style,
        modes: Modes,
        now: Instant,
    ) -> Self {
        let mut sheet = Sheet::new(Some(style));
        style.titles(&mut sheet.out);
        sheet.modes = modes;
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            due,
            start: now,
            linger_us,
            last_at: now,
            sending: Box::default(),
            sheet,
            sent: decode::stream_of(protocol, Direction::Out),
            received: decode::stream_of(protocol, Direction::In),
            epoch_us: epoch.map_or(0, |since| since.as_micros() as u64),
            modes,
            frames: 0,
            lost: 0,
        }
    }

    /// Whether everything was sent, and the time to listen is over.
    pub(crate) fn is_over(&self, now: Instant) -> bool {
        self.due.is_empty() && now.as_micros() >= self.last_at.as_micros() + self.linger_us
    }

    /// A node that has answered in another mode than the one its commands were meant for.
    pub(crate) fn turncoat(&self) -> Option<(NodeId, Mode)> {
        NodeId::ALL.into_iter().find_map(|node| {
            let (meant, now) = (self.modes.of(node)?, self.sheet.modes.of(node)?);
            (meant != now).then_some((node, now))
        })
    }

    /// Lists what is held back, at the end.
    pub(crate) fn finish(&mut self) -> Option<String> {
        self.received.finish(&mut self.sheet);
        self.sent.finish(&mut self.sheet);
        self.poll_event()
    }

    fn micros(&self, now: Instant) -> Option<u64> {
        Some(self.epoch_us + now.as_micros().saturating_sub(self.start.as_micros()))
    }
}

impl Endpoint for Player {
    /// Finished lines.
    type Event = String;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        if !bytes.is_empty() {
            let micros = self.micros(now);
            self.received.feed(bytes, micros, &mut self.sheet);
        }
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let at = self.poll_timeout()?;
        if now < at {
            return None;
        }
        self.sending = self.due.pop_front()?.bytes;
        (self.last_at, self.frames) = (now, self.frames + 1);
        let micros = self.micros(now);
        self.sent.feed(&self.sending, micros, &mut self.sheet);
        Some(&self.sending)
    }

    fn handle_unsent(&mut self, _: Unsent, _: Instant) {
        self.lost += 1;
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
        let after_us = self.due.front()?.after_us;
        Some(Instant::from_micros(self.start.as_micros() + after_us))
    }
}
