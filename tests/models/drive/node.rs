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
    let is_of = |mode| is_stop(mode, &frame[2..6]);
    frame[0] == 0xBB && !is_of(Mode::Velocity) && !is_of(Mode::Position)
}

/// Whether this is the payload of a stop: 0 rps, or the node's own rotation, 1, which as a speed is
/// as good as 0 rps.
pub(crate) fn is_stop(mode: Mode, payload: &[u8]) -> bool {
    match mode {
        Mode::Velocity => payload == [0; 4] || payload[2..] == [1, 0],
        Mode::Position => payload[2..] == [1, 0],
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
    /// A little late, and in the other mode.
    Other,
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
    /// Every WRITE reaches it damaged, every READ whole.
    pub(crate) is_deaf: bool,
    /// The last command that it has accepted, if it moves the motor.
    pub(crate) told: Option<[u8; 4]>,
    /// Where its shaft is: elsewhere at each answer, while a position node is told to move.
    pub(crate) count: i16,
    /// When the last answer in the other mode arrives.
    other_us: u64,
    pub(crate) log: Vec<Entry>,
}

impl Node {
    pub(crate) const fn new(mode: Mode) -> Self {
        Self {
            mode,
            answers: VecDeque::new(),
            is_gone: false,
            is_deaf: false,
            told: None,
            count: 7,
            other_us: 0,
            log: Vec::new(),
        }
    }
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
            let payload = [frame[2], frame[3], frame[4], frame[5]];
            node.log.push(Entry::Wrote(payload));
            if !node.is_deaf {
                node.told = Some(payload).filter(|it| !is_stop(node.mode, it));
            }
            return None;
        }
        let answer = node.answers.pop_front();
        let is_turning = node.mode == Mode::Velocity;
        node.count += if node.told.is_some() && !is_turning { 10 } else { 0 };
        let mut bytes = if is_turning == (answer != Some(Answer::Other)) {
            let speed = f32::from_le_bytes(node.told.filter(|_| is_turning).unwrap_or_default());
            VelocityResponse::new(NodeId::N1, Rps::new(speed).unwrap()).as_bytes().to_vec()
        } else {
            let place = Position::new(node.count, 1);
            PositionResponse::new(NodeId::N1, place).as_bytes().to_vec()
        };
        let mut after_us = 50;
        match answer {
            None => {}
            Some(Answer::Other) => after_us = 540,
            Some(Answer::Late) => after_us = 800,
            Some(Answer::Lost) => bytes.clear(),
            Some(Answer::Damaged) => bytes[4] ^= 0x10,
            Some(Answer::CutOff) => bytes.truncate(5),
        }
        let arrival_us = end_us + after_us + BYTE_US * bytes.len() as u64;
        if answer == Some(Answer::Other) {
            node.other_us = arrival_us;
        }
        node.log.push(match answer {
            None => Entry::Answered(arrival_us),
            Some(_) => Entry::Failed,
        });
        Some((after_us, bytes))
    }

    fn doubts_us(&self) -> u64 {
        self.0.borrow().other_us
    }
}

/// Number of stop WRITEs each followed by an answer, and whether a WRITE waits for its answer.
pub(crate) fn progress(log: &[Entry], mode: Mode, now_us: u64) -> (u8, bool) {
    let (mut pairs, mut is_written) = (0, false);
    for entry in log {
        match *entry {
            Entry::Wrote(payload) => is_written = is_stop(mode, &payload),
            Entry::Answered(at_us) if is_written && at_us <= now_us && pairs < 2 => {
                (pairs, is_written) = (pairs + 1, false);
            }
            _ => {}
        }
    }
    (pairs, is_written)
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
