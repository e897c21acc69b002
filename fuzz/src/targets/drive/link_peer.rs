//! The other end of a rover's link, written without the library: it notes the frames that it hears,
//! and as a robot answers pings and calibrations.

use std::{cell::RefCell, rc::Rc};

use super::super::{oracle, port::Peer};

#[derive(Debug, Default)]
pub(super) struct Far {
    tail: Vec<u8>,
    last_us: u64,
    /// The frames heard, whole, and when each was complete.
    pub(super) heard: Vec<(u64, Vec<u8>)>,
    pub(super) is_mute: bool,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Link(pub(super) Rc<RefCell<Far>>);

pub(super) fn frame(id: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = [&[0xFD, 0xFF, body.len() as u8 + 4, 0, id, 0][..], body, &[0, 0]].concat();
    oracle::seal(&mut frame);
    frame
}

impl Far {
    /// The frame that is complete, if any; a pause of 20 ms ends another.
    fn next(&mut self, byte: u8, at_us: u64) -> Option<Vec<u8>> {
        if at_us - self.last_us > 20_000 {
            self.tail.clear();
        }
        self.last_us = at_us;
        self.tail.push(byte);
        loop {
            let len = match *self.tail.as_slice() {
                [] | [0xFD] | [0xFD, 0xFF] | [0xFD, 0xFF, _] => return None,
                [0xFD, 0xFF, len @ 4..=60, 0, ..] => usize::from(len) + 4,
                _ => 1,
            };
            if self.tail.len() < len {
                return None;
            }
            if len > 1
                && oracle::crc(&self.tail[..len - 2]).to_le_bytes() == self.tail[len - 2..len]
            {
                let rest = self.tail.split_off(len);
                return Some(core::mem::replace(&mut self.tail, rest));
            }
            self.tail.remove(0);
        }
    }
}

impl Link {
    /// It, as the peer of a port.
    pub(super) fn peer(&self) -> Option<Peer> {
        let far = self.clone();
        Some(Box::new(move |byte, at_us| far.hear(byte, at_us)))
    }

    fn hear(&self, byte: u8, at_us: u64) -> Vec<(u64, u8)> {
        let mut far = self.0.borrow_mut();
        let Some(heard) = far.next(byte, at_us) else { return Vec::new() };
        far.heard.push((at_us, heard.clone()));
        let answer = match (heard[4], heard.len()) {
            _ if far.is_mute => return Vec::new(),
            (1, 8) => frame(1, &[0]),
            (3 | 4, 9) => frame(heard[4], &[heard[6], 0]),
            _ => return Vec::new(),
        };
        answer.into_iter().zip(1..).map(|(byte, n)| (at_us + 300 + 87 * n, byte)).collect()
    }
}

/// Speed and turn of a motor frame.
pub(super) fn motion(frame: &[u8]) -> Option<(i16, i16)> {
    let percent = |at: usize| i16::from_le_bytes([frame[at], frame[at + 1]]);
    (frame.len() == 24 && frame[4] == 2).then(|| (percent(6), percent(8)))
}
