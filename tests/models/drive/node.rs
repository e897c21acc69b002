//! A node of a motor bus that follows its commands, and logs what it received and sent.

use std::{cell::RefCell, collections::VecDeque, rc::Rc};

use axlewire::ikeya::PositionResponse;

use super::*;
use crate::names::*;

/// 500 kbit/s.
pub(crate) const BYTE_US: u64 = 20;

pub(crate) const SPEECH: Speech =
    Speech { shape, moves, byte_us: BYTE_US, pause_us: 5 * BYTE_US, needs_silence: true };

fn moves(frame: &[u8]) -> bool {
    let stops = [Mode::Velocity, Mode::Position].map(stop_payload);
    frame[0] == 0xBB && !stops.iter().any(|stop| frame[2..6] == *stop)
}

/// The payload of a stop: 0 rps, or the node's position, count 7 and rotation 1.
pub(crate) const fn stop_payload(mode: Mode) -> [u8; 4] {
    match mode {
        Mode::Velocity => [0; 4],
        Mode::Position => [7, 0, 1, 0],
    }
}

/// Set-points of both kinds: 1 and 2 rps, or 1 and 2 rotations away.
pub(crate) fn target_payload(mode: Mode, number: u8) -> [u8; 4] {
    match mode {
        Mode::Velocity => f32::from(number).to_le_bytes(),
        Mode::Position => [7, 0, 1 + number, 0],
    }
}

/// The fate of the next answers.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Answer {
    Late,
    Lost,
    Damaged,
    CutOff,
}

/// What a node has received and sent, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Entry {
    Wrote([u8; 4]),
    /// A READ was answered correctly; the last byte of the answer arrived at this time.
    Answered(u64),
    /// A READ was not answered, or not correctly.
    Failed,
}

pub(crate) struct Node {
    pub(crate) mode: Mode,
    pub(crate) answers: VecDeque<Answer>,
    /// Without power.
    pub(crate) is_gone: bool,
    pub(crate) log: Vec<Entry>,
}

pub(crate) type SharedNode = Rc<RefCell<Node>>;

pub(crate) struct Ear(pub(crate) SharedNode);

impl Peer for Ear {
    fn hear(&mut self, frame: &[u8], end_us: u64) -> Option<(u64, Vec<u8>)> {
        let mut node = self.0.borrow_mut();
        if node.is_gone || frame[1] != NodeId::N1.get() {
            node.log.extend((frame[0] == 0xAA && frame[1] == 1).then_some(Entry::Failed));
            return None;
        }
        if frame[0] == 0xBB {
            node.log.push(Entry::Wrote([frame[2], frame[3], frame[4], frame[5]]));
            return None;
        }
        let mut bytes = match node.mode {
            Mode::Velocity => {
                VelocityResponse::new(NodeId::N1, Rps::new(3.0).unwrap()).as_bytes().to_vec()
            }
            Mode::Position => {
                PositionResponse::new(NodeId::N1, Position::new(7, 1)).as_bytes().to_vec()
            }
        };
        let mut after_us = 50;
        let answer = node.answers.pop_front();
        match answer {
            None => {}
            Some(Answer::Late) => after_us = 800,
            Some(Answer::Lost) => bytes.clear(),
            Some(Answer::Damaged) => bytes[4] ^= 0x10,
            Some(Answer::CutOff) => bytes.truncate(5),
        }
        let arrival_us = end_us + after_us + BYTE_US * bytes.len() as u64;
        node.log.push(match answer {
            None => Entry::Answered(arrival_us),
            Some(_) => Entry::Failed,
        });
        Some((after_us, bytes))
    }
}

/// Number of stop WRITEs each followed by an answer, and whether a WRITE waits for its answer.
pub(crate) fn progress(log: &[Entry], stop: [u8; 4], now_us: u64) -> (u8, bool) {
    let (mut pairs, mut is_written) = (0, false);
    for entry in log {
        match *entry {
            Entry::Wrote(payload) => is_written = payload == stop,
            Entry::Answered(at_us) if is_written && at_us <= now_us && pairs < 2 => {
                (pairs, is_written) = (pairs + 1, false);
            }
            _ => {}
        }
    }
    (pairs, is_written)
}

/// Two of them, according to the node's log.
pub(crate) fn is_paid(log: &[Entry], stop: [u8; 4], now_us: u64) -> bool {
    progress(log, stop, now_us).0 >= 2
}

/// A packet of a master as documented: a header, an id, the payload of a WRITE, the CRC.
fn shape(bytes: &[u8]) -> Shape {
    let len = match bytes.first() {
        None => return Shape::Part,
        Some(0xAA) => 4,
        Some(0xBB) => 8,
        Some(_) => return Shape::Bad,
    };
    if bytes.get(1).is_some_and(|id| !(1..=8).contains(id)) || bytes.len() > len {
        return Shape::Bad;
    }
    if bytes.len() < len {
        return Shape::Part;
    }
    if crc(bytes) == 0 { Shape::Whole } else { Shape::Bad }
}

/// CRC-16/MODBUS, bit by bit; 0 over a frame with its CRC.
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte), |crc, _| (crc >> 1) ^ (0xA001 * (crc & 1)))
    })
}
