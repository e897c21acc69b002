//! Packets of both kinds of boards, read and written independently of the library.

use axlewire::ikeya::{
    Mode, NodeId, Position, Rps, Target,
    board::{OneMotor, ThreeMotors},
};

#[path = "../harness/board_packets.rs"]
#[allow(dead_code, reason = "not every user of this kit writes and answers")]
mod board_packets;

pub(crate) use board_packets::BoardPackets;

/// What a world needs of a kind of board. All three motors always get the same command.
pub(crate) trait Kit: BoardPackets {
    /// Offset of the first motor's rotation in a packet.
    const ROTATION_AT: usize;

    fn speed(rps: f32) -> Self::Velocity;
    fn place(position: Position) -> Self::Position;
}

impl Kit for OneMotor {
    const ROTATION_AT: usize = 4;

    fn speed(rps: f32) -> Rps {
        Rps::new(rps).unwrap()
    }

    fn place(position: Position) -> Position {
        position
    }
}

impl Kit for ThreeMotors {
    const ROTATION_AT: usize = 8;

    fn speed(rps: f32) -> [Rps; 3] {
        [Rps::new(rps).unwrap(); 3]
    }

    fn place(position: Position) -> [Position; 3] {
        [position; 3]
    }
}

/// A packet of the master.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sent {
    pub(crate) node: NodeId,
    /// The written value, in both readings; `None` for a READ.
    pub(crate) write: Option<Write>,
    pub(crate) len: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Write {
    /// The bits of the `f32`.
    pub(crate) speed: u32,
    /// Count and rotation.
    pub(crate) place: (i16, i16),
}

impl Sent {
    pub(crate) fn read<B: Kit>(bytes: &[u8]) -> Self {
        let i16_at = |at: usize| i16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let node = NodeId::ALL[usize::from(bytes[1]) - 1];
        let write = (bytes[0] == 0xBB).then(|| Write {
            speed: u32::from_le_bytes([bytes[2], bytes[3], bytes[4], bytes[5]]),
            place: (i16_at(2), i16_at(B::ROTATION_AT)),
        });
        Self { node, write, len: bytes.len() }
    }

    pub(crate) fn is_exchange<B: Kit>(&self) -> bool {
        self.write.is_none() || B::ANSWERS_WRITE
    }
}

/// What a node answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reply {
    pub(crate) node: NodeId,
    pub(crate) mode: Mode,
    /// Count and rotation of a position node.
    pub(crate) place: (i16, i16),
    /// Whether a velocity node turns, at 3 rps.
    pub(crate) is_moving: bool,
}

impl Reply {
    pub(crate) fn bytes<B: Kit>(&self) -> Vec<u8> {
        let measured = match self.mode {
            Mode::Velocity => Target::Velocity(B::speed(3.0 * f32::from(self.is_moving))),
            Mode::Position => Target::Position(B::place(Position::new(self.place.0, self.place.1))),
        };
        B::answer(self.node, measured)
    }
}
