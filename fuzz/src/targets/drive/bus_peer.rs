//! The nodes of a bus, as far as a master can see them, written without the library.

use std::{cell::RefCell, rc::Rc};

use super::super::{oracle, port::Peer};

/// What a node has heard and said, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Heard {
    /// A WRITE on the line. A node that is away for that moment misses it, and then answers the
    /// next READ: no master can know, so a stop has two payments (I12).
    Write([u8; 4]),
    /// An answer with this payload.
    Answered([u8; 4]),
}

#[derive(Debug, Default)]
pub(super) struct Nodes {
    tail: Vec<u8>,
    last_us: u64,
    /// Whether each node answers, and whether in position mode.
    pub(super) is_there: [bool; 8],
    pub(super) is_position: [bool; 8],
    /// Whether WRITEs reach each node damaged, although READs do not.
    pub(super) is_deaf: [bool; 8],
    pub(super) log: [Vec<Heard>; 8],
    /// The last WRITE that each has accepted in its mode.
    told: [[u8; 4]; 8],
    /// Where each shaft is in turn 3: elsewhere at each answer, while it is told to move.
    counts: [i16; 8],
}

impl Nodes {
    /// Moves a mode switch: the command is forgotten.
    pub(super) fn switch(&mut self, index: usize, is_position: bool) {
        if self.is_position[index] != is_position {
            (self.is_position[index], self.told[index]) = (is_position, [0, 0, 3, 0]);
        }
    }

    /// Whether the last command of a node is to stand still: a small speed, or a position of its
    /// own in turn 3, where no set-point is.
    pub(super) fn is_told_to_stop(&self, index: usize) -> bool {
        let told = self.told[index];
        match self.is_position[index] {
            true => told[2..] == [3, 0] && told[1] < 0x80,
            false => f32::from_le_bytes(told).abs() < 0.05,
        }
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Bus(pub(super) Rc<RefCell<Nodes>>);

impl Bus {
    /// It, as the peer of a port.
    pub(super) fn peer(&self) -> Option<Peer> {
        let far = self.clone();
        Some(Box::new(move |byte, at_us| far.hear(byte, at_us)))
    }

    /// Finds requests as a receiver on a UART does: a pause ends a packet.
    fn hear(&self, byte: u8, at_us: u64) -> Vec<(u64, u8)> {
        let mut nodes = self.0.borrow_mut();
        if at_us - nodes.last_us > 120 {
            nodes.tail.clear();
        }
        nodes.last_us = at_us;
        nodes.tail.push(byte);
        let (len, is_write) = match nodes.tail[0] {
            0xAA => (4, false),
            0xBB => (8, true),
            _ => (1, false),
        };
        if nodes.tail.len() < len {
            return Vec::new();
        }
        let packet = core::mem::take(&mut nodes.tail);
        let (body, crc) = packet.split_at(len.max(3) - 2);
        if len == 1 || oracle::crc(body).to_le_bytes() != crc || !(1..=8).contains(&packet[1]) {
            // The rest may be the start of another packet.
            nodes.tail = packet[1..].to_vec();
            return Vec::new();
        }
        let index = usize::from(packet[1] - 1);
        if is_write {
            let payload = [packet[2], packet[3], packet[4], packet[5]];
            nodes.log[index].push(Heard::Write(payload));
            if nodes.is_there[index] && !nodes.is_deaf[index] {
                nodes.told[index] = payload;
            }
            return Vec::new();
        }
        if !nodes.is_there[index] {
            return Vec::new();
        }
        let payload = if nodes.is_position[index] {
            let step = if nodes.is_told_to_stop(index) { 0 } else { 10 };
            nodes.counts[index] = (nodes.counts[index] + step) % 8000;
            let [low, high] = nodes.counts[index].to_le_bytes();
            [low, high, 3, 0]
        } else {
            nodes.told[index]
        };
        nodes.log[index].push(Heard::Answered(payload));
        let header = if nodes.is_position[index] { 0x56 } else { 0x55 };
        let mut answer = [&[header, packet[1]][..], &payload, &[0, 0]].concat();
        oracle::seal(&mut answer);
        answer.into_iter().zip(1..).map(|(byte, n)| (at_us + 50 + 20 * n, byte)).collect()
    }
}

/// Number of stop WRITEs that were followed by an answer.
pub(super) fn paid(log: &[Heard], is_position: bool) -> u32 {
    let (mut paid, mut is_written) = (0, false);
    for heard in log {
        match heard {
            Heard::Write(payload) => is_written = is_position || *payload == [0; 4],
            Heard::Answered(_) => paid += u32::from(core::mem::take(&mut is_written)),
        }
    }
    paid
}
