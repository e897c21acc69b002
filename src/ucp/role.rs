//! What both roles are made of: received bytes and the frame going out.

use super::{Body, Decoder, Frame, MAX_LEN, Message};
use crate::{
    stream::{Counters, Encode, Event},
    time::{Duration, Instant, wire_time},
};

/// Shortest period or timeout that a role keeps: a shorter one would make its driver spin.
pub(super) const SHORTEST: Duration = Duration::from_millis(1);

/// Longest pause inside a frame that is sent: a robot of this crate gives one up soon after. Ruling U16
/// has 20 ms.
pub(super) const FRAME_PAUSE: Duration = Duration::from_millis(5);

/// Received bytes, made frames of.
#[derive(Clone, Debug)]
pub(super) struct Inbox {
    decoder: Decoder,
    /// When the newest byte had arrived, at the earliest.
    last: Instant,
    /// When it was handed in: the rest of its frame may come from then on.
    read_at: Instant,
    /// When the oldest byte that the decoder holds had arrived.
    since: Instant,
    /// How many of the received bytes the decoder has reported, in frames and gaps.
    reported: u64,
    /// A pause this long cuts a frame off.
    quiet: Duration,
}

impl Inbox {
    /// A pause of two byte times and `margin` cuts a frame off.
    pub(super) fn new(baud: u32, margin: Duration) -> Self {
        const ZERO: Instant = Instant::from_micros(0);
        let quiet = (wire_time(2, baud) + margin).max(SHORTEST);
        Self { decoder: Decoder::new(), last: ZERO, read_at: ZERO, since: ZERO, reported: 0, quiet }
    }

    /// Hands on the frames that `bytes` complete, and when they had arrived. The bytes have arrived
    /// at any time from `at` to `now`.
    pub(super) fn take(
        &mut self,
        bytes: &[u8],
        at: Instant,
        now: Instant,
        mut receive: impl FnMut(&Frame, Instant),
    ) {
        if !bytes.is_empty() {
            let received = self.decoder.received();
            (self.last, self.read_at) = (at, now);
            self.decode(bytes, received, &mut receive);
            if self.decoder.pending() <= bytes.len() {
                self.since = at;
            }
        }
    }

    /// Once the line has been quiet, nothing that is pending will be completed: hands on the frames
    /// that a false header has held back (ruling B3).
    pub(super) fn settle(&mut self, now: Instant, mut receive: impl FnMut(&Frame, Instant)) {
        if reached(self.deadline(), now) {
            while self.decoder.pending() > 0 {
                self.decoder.idle();
                self.decode(&[], self.decoder.received(), &mut receive);
            }
        }
    }

    /// When the line counts as quiet, if that matters.
    pub(super) fn deadline(&self) -> Option<Instant> {
        (self.decoder.pending() > 0).then(|| self.read_at + self.quiet)
    }

    pub(super) fn counters(&self) -> Counters {
        self.decoder.counters()
    }

    /// A frame whose bytes are all among the first `received` had arrived before, held back by a
    /// false header: it is as old as the first byte that was held, for a command that comes to
    /// light late is an old one.
    fn decode(
        &mut self,
        mut bytes: &[u8],
        received: u64,
        receive: &mut impl FnMut(&Frame, Instant),
    ) {
        while let Some(event) = self.decoder.decode_buffered(&mut bytes) {
            match event {
                // A gap is in the counters already.
                Event::Skipped(gap) => self.reported = self.reported.wrapping_add(gap.len),
                Event::Frame(frame) => {
                    self.reported = self.reported.wrapping_add(frame.as_bytes().len() as u64);
                    receive(frame, if self.reported <= received { self.since } else { self.last });
                }
            }
        }
    }
}

/// Writes a frame to the front of `buffer` and says how long it is.
pub(super) fn write<B: Body>(body: B, index: u8, buffer: &mut [u8; MAX_LEN]) -> usize {
    body.frame(index).encode(buffer).map_or(0, <[u8]>::len)
}

/// Is this message one that only a host sends? `None` for a message of neither side (ruling U4).
pub(super) const fn is_from_host(message: &Message<'_>) -> Option<bool> {
    Some(match message {
        Message::Ping(_)
        | Message::MotorControl(_)
        | Message::CalibrationStart(_)
        | Message::CalibrationEnd(_)
        | Message::ImuBiasAck(_)
        | Message::MagBiasAck(_)
        | Message::Biases(_)
        | Message::OtaRequest(_)
        | Message::SetNetworkState(_)
        | Message::SetNetworkStateWide(_) => true,
        Message::Pong(_)
        | Message::CalibrationStartAck(_)
        | Message::CalibrationEndAck(_)
        | Message::Report(_)
        | Message::ImuBias(_)
        | Message::MagBias(_)
        | Message::BiasRequest(_)
        | Message::OtaAck(_) => false,
        Message::Unknown(_) => return None,
    })
}

/// Has this deadline been reached?
pub(super) fn reached(deadline: Option<Instant>, now: Instant) -> bool {
    deadline.is_some_and(|at| at <= now)
}

/// Counts one more, up to the largest number there is.
pub(super) const fn bump(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Takes back one that was counted and did not happen.
pub(super) const fn uncount(counter: &mut u32) {
    *counter = counter.saturating_sub(1);
}
