//! Echo: on two wires a master hears its own bytes.

use heapless::Vec;

/// Longest echo in flight, in bytes: a set-point and a stop for each of eight nodes, none of them
/// answered, and the READ after them.
const LEN: usize = 8 * (8 + 8) + 4;

/// The bytes that an echoing line will return, in order.
#[derive(Clone, Debug)]
pub(super) struct Echo {
    /// Cleared once all of it has been heard.
    sent: Vec<u8, LEN>,
    /// Number of these bytes heard.
    heard: usize,
    /// Length of the packet added last.
    last: usize,
}

/// Echo found in the input.
pub(super) struct Removed {
    /// Number of own bytes removed.
    pub(super) bytes: u32,
    /// Whether the echo differed from what had been sent.
    pub(super) is_wrong: bool,
}

impl Echo {
    pub(super) const fn new() -> Self {
        Self { sent: Vec::new(), heard: 0, last: 0 }
    }

    /// Adds a packet that has been handed out.
    pub(super) fn expect(&mut self, packet: &[u8]) {
        if self.sent.extend_from_slice(packet).is_err() {
            // On a line without echo the buffer must not fill up forever.
            self.forget_all();
            let _ = self.sent.extend_from_slice(packet);
        }
        self.last = packet.len();
    }

    /// Forgets the packet handed out last: it has not left.
    pub(super) fn forget_last(&mut self) {
        let before = self.sent.len().saturating_sub(core::mem::take(&mut self.last));
        self.sent.truncate(before.max(self.heard));
    }

    /// Forgets everything: an unknown part of the packet handed out last has left.
    pub(super) fn forget_all(&mut self) {
        self.sent.clear();
        (self.heard, self.last) = (0, 0);
    }

    /// Removes the echo from the front of the input.
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
