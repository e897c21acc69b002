//! Echo: on two wires a master hears its own bytes again.

use heapless::Vec;

/// Longest echo that can be on its way, bytes: a set-point and a stop for each of eight nodes, none
/// of them answered, and the READ behind them.
const LEN: usize = 8 * (8 + 8) + 4;

/// The bytes that an echoing line will give back, in order.
#[derive(Clone, Debug)]
pub(super) struct Echo {
    /// Begins anew whenever all of it has been heard.
    sent: Vec<u8, LEN>,
    /// How many of them have been heard.
    heard: usize,
    /// Length of the packet that was added last.
    last: usize,
}

/// What the input was made of.
pub(super) struct Removed {
    /// Own bytes, removed.
    pub(super) bytes: u32,
    /// The echo was not what had been sent.
    pub(super) is_wrong: bool,
}

impl Echo {
    pub(super) const fn new() -> Self {
        Self { sent: Vec::new(), heard: 0, last: 0 }
    }

    /// A packet has been handed out.
    pub(super) fn expect(&mut self, packet: &[u8]) {
        if self.sent.extend_from_slice(packet).is_err() {
            // A line that gives back nothing must not fill the buffer for ever.
            self.forget_all();
            let _ = self.sent.extend_from_slice(packet);
        }
        self.last = packet.len();
    }

    /// The packet that was handed out last has not left.
    pub(super) fn forget_last(&mut self) {
        let before = self.sent.len().saturating_sub(core::mem::take(&mut self.last));
        self.sent.truncate(before.max(self.heard));
    }

    /// A part of the packet that was handed out last has left, nobody knows how much.
    pub(super) fn forget_all(&mut self) {
        self.sent.clear();
        (self.heard, self.last) = (0, 0);
    }

    /// Takes the echo off the front of the input.
    pub(super) fn remove(&mut self, input: &mut &[u8]) -> Removed {
        let expected = self.sent.get(self.heard..).unwrap_or_default();
        let same = expected.iter().zip(*input).take_while(|(sent, heard)| sent == heard).count();
        let is_wrong = same < expected.len().min(input.len());
        self.heard += same;
        if is_wrong || same == expected.len() {
            self.forget_all();
        }
        *input = input.get(same..).unwrap_or_default();
        Removed { bytes: same as u32, is_wrong }
    }
}
