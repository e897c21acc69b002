//! One direction of a line: frames take their time, and some are damaged on the way.

use std::collections::VecDeque;

use arbitrary::Arbitrary;
use axlewire::time::{Duration, Instant};

/// What happens to a frame on its way.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub(super) enum Damage {
    Flip {
        at: u8,
        bit: u8,
    },
    Lose {
        at: u8,
    },
    Insert {
        at: u8,
        byte: u8,
    },
    /// Only this many bytes arrive.
    Cut {
        at: u8,
    },
    /// Nothing arrives.
    All,
    Delay {
        us: u16,
    },
    /// A pause in the middle.
    Split {
        at: u8,
        us: u16,
    },
}

/// A byte under way, and its place in a frame that was sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carried {
    pub(super) byte: u8,
    pub(super) origin: Option<(u64, usize)>,
}

#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub(super) at: Instant,
    pub(super) bytes: Vec<Carried>,
}

#[derive(Debug)]
pub(super) struct Way {
    byte_us: u32,
    /// Longest delay of a frame.
    longest_us: u16,
    free: Option<Instant>,
    air: VecDeque<Piece>,
    damages: VecDeque<Damage>,
}

impl Way {
    pub(super) fn new(byte_us: u32, longest_us: u16) -> Self {
        Self { byte_us, longest_us, free: None, air: VecDeque::new(), damages: VecDeque::new() }
    }

    /// The next frame is damaged.
    pub(super) fn damage(&mut self, damage: Damage) {
        self.damages.push_back(damage);
    }

    pub(super) fn heal(&mut self) {
        self.damages.clear();
    }

    pub(super) fn clear(&mut self) {
        self.air.clear();
        self.free = None;
    }

    /// A frame is sent from `now` on, after what is still being sent. Its last byte is complete at
    /// the returned time.
    pub(super) fn send(&mut self, frame: &[u8], number: u64, now: Instant) -> Instant {
        let bytes = frame.iter().enumerate();
        let bytes = bytes.map(|(index, &byte)| Carried { byte, origin: Some((number, index)) });
        self.carry(bytes.collect(), now)
    }

    /// Bytes that nobody sent.
    pub(super) fn noise(&mut self, bytes: &[u8], now: Instant) {
        let damages = core::mem::take(&mut self.damages);
        self.carry(bytes.iter().map(|&byte| Carried { byte, origin: None }).collect(), now);
        self.damages = damages;
    }

    fn carry(&mut self, mut bytes: Vec<Carried>, now: Instant) -> Instant {
        let begin = self.free.map_or(now, |free| free.max(now));
        let end = begin + Duration::from_micros(self.byte_us * bytes.len() as u32);
        self.free = Some(end);
        let mut at = end;
        let place = |at: u8, len: usize| usize::from(at) % len.max(1);
        let mut rest = None;
        match self.damages.pop_front() {
            None => {}
            Some(Damage::Flip { at, bit }) => {
                let at = place(at, bytes.len());
                bytes[at].byte ^= 1 << (bit % 8);
                bytes[at].origin = None;
            }
            Some(Damage::Lose { at }) => drop(bytes.remove(place(at, bytes.len()))),
            Some(Damage::Insert { at, byte }) => {
                bytes.insert(place(at, bytes.len()), Carried { byte, origin: None });
            }
            Some(Damage::Cut { at }) => bytes.truncate(place(at, bytes.len())),
            Some(Damage::All) => bytes.clear(),
            Some(Damage::Delay { us }) => {
                at += Duration::from_micros(u32::from(us % self.longest_us));
            }
            Some(Damage::Split { at: split, us }) => {
                let behind = bytes.split_off(place(split, bytes.len()));
                let pause = Duration::from_micros(u32::from(us % self.longest_us));
                rest = Some(Piece { at: at + pause, bytes: behind });
            }
        }
        // Bytes keep their order.
        at = self.air.back().map_or(at, |last| last.at.max(at));
        for piece in [Some(Piece { at, bytes }), rest].into_iter().flatten() {
            if !piece.bytes.is_empty() {
                self.air.push_back(piece);
            }
        }
        end
    }

    pub(super) fn next_at(&self) -> Option<Instant> {
        self.air.front().map(|piece| piece.at)
    }

    pub(super) fn arrived(&mut self, now: Instant) -> Option<Piece> {
        self.air.front().is_some_and(|piece| piece.at <= now).then(|| self.air.pop_front())?
    }
}
