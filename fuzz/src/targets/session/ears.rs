//! What a receiver can find in its bytes: every window that is a frame by the oracle. A frame that
//! was never sent, which the damage itself has made, is unavoidable; a session ends there.

use super::{
    oracle::{self, Rules},
    way::Carried,
};

#[derive(Debug)]
pub(super) struct Ears {
    rules: Rules,
    longest: usize,
    tail: Vec<Carried>,
}

/// A window that is a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Found {
    /// The frame with this number, as it was sent.
    Sent(u64),
    /// Made by damage.
    Phantom,
}

impl Ears {
    pub(super) fn new(rules: Rules) -> Self {
        let longest = match rules {
            Rules::Ikeya { long, .. } => long,
            Rules::Ucp { cap } => cap + 4,
        };
        Self { rules, longest, tail: Vec::new() }
    }

    /// The frames that end in these bytes, in order.
    pub(super) fn take(&mut self, bytes: &[Carried]) -> Vec<Found> {
        let mut found = Vec::new();
        for &byte in bytes {
            self.tail.push(byte);
            if self.tail.len() > 2 * self.longest {
                self.tail.drain(..self.longest);
            }
            let first = self.tail.len().saturating_sub(self.longest);
            for start in first..self.tail.len() {
                found.extend(self.frame_at(start));
            }
        }
        found
    }

    fn frame_at(&self, start: usize) -> Option<Found> {
        let window = &self.tail[start..];
        if !matches!(window[0].byte, 0xAA | 0xBB | 0x55 | 0x56 | 0xFD) || window.len() < 4 {
            return None;
        }
        let bytes: Vec<u8> = window.iter().map(|carried| carried.byte).collect();
        if oracle::promised_len(self.rules, &bytes) != Ok(Some(bytes.len())) {
            return None;
        }
        let (body, crc) = bytes.split_at(bytes.len() - 2);
        if oracle::crc(body).to_le_bytes() != crc {
            return None;
        }
        let origin = |index: usize| window[index].origin;
        let Some((number, 0)) = origin(0) else { return Some(Found::Phantom) };
        let is_whole = (0..window.len()).all(|index| origin(index) == Some((number, index)));
        Some(if is_whole { Found::Sent(number) } else { Found::Phantom })
    }
}
