//! The two kinds of boards, with one motor and with three; the same master and slave serve both.

use core::fmt;

use crate::{encode::Encode, stream::Framing};

use super::{
    three,
    units::{Mode, NodeId, Position, Rps},
};

/// The packets of a board with one motor.
mod one {
    pub(super) use crate::ikeya::{framing::*, wire::*};
}

/// A kind of board: its units, its packets, and whether it answers a WRITE (rulings I3, I10).
///
/// | | [`OneMotor`] | [`ThreeMotors`] |
/// |---|---|---|
/// | target speed, [`Velocity`](Units::Velocity) | [`Rps`] | `[Rps; 3]` |
/// | measured speed, [`RawVelocity`](Units::RawVelocity) | `f32`, any bits | `[f32; 3]` |
/// | target or measured position, [`Position`](Units::Position) | [`Position`] | `[Position; 3]` |
/// | packets | [`ikeya`](crate::ikeya), 8 bytes | [`three`], 16 bytes |
/// | a WRITE is answered | no | yes, with the status |
///
/// Implemented by these two only; how it makes packets is private:
///
/// ```compile_fail,E0624
/// use axlewire::ikeya::{NodeId, board::Board};
/// fn zero<B: Board>() {
///     B::write_velocity(NodeId::N1, B::ZERO);
/// }
/// ```
#[expect(private_bounds, reason = "only this crate implements it, and calls what it is made of")]
pub trait Board: Packets {}

impl Board for OneMotor {}
impl Board for ThreeMotors {}

/// The units of a kind of board, see [`Board`].
pub trait Units: Copy + fmt::Debug + PartialEq + 'static {
    /// A target or current speed.
    type Velocity: Copy + fmt::Debug + PartialEq;
    /// A speed as carried in a packet: any bits.
    type RawVelocity: Copy + fmt::Debug + PartialEq;
    /// A target or current position.
    type Position: Copy + fmt::Debug + PartialEq;

    /// Zero speed.
    const ZERO: Self::Velocity;

    /// Whether a WRITE is answered with the status.
    const ANSWERS_WRITE: bool;
}

/// What a kind of board sends and understands.
pub(crate) trait Packets: Units {
    /// A WRITE packet.
    type Write: Encode;
    /// A velocity response.
    type VelocityResponse: Encode;
    /// A position response.
    type PositionResponse: Encode;
    /// Framing of the packets to slaves.
    type ToSlave: Framing + Clone + fmt::Debug;
    /// Framing of the packets to the master.
    type ToMaster: Framing + Clone + fmt::Debug;
    /// Framing of the packets that a slave hears on two wires.
    type BothDirections: Framing + Clone + fmt::Debug;

    /// A WRITE for a velocity node.
    fn write_velocity(id: NodeId, target: Self::Velocity) -> Self::Write;

    /// A WRITE for a position node.
    fn write_position(id: NodeId, target: Self::Position) -> Self::Write;

    /// The answer of a velocity node.
    fn velocity_response(id: NodeId, current: Self::Velocity) -> Self::VelocityResponse;

    /// The answer of a position node.
    fn position_response(id: NodeId, current: Self::Position) -> Self::PositionResponse;

    /// The speed that was meant; `None` for NaN and infinities.
    fn finite(raw: Self::RawVelocity) -> Option<Self::Velocity>;

    /// Whether the speed is below 0.05 rps, which counts as standstill (I12). NaN is not.
    fn is_still(speed: Self::RawVelocity) -> bool;

    /// Longest way of a motor between two positions, counts.
    fn distance(here: Self::Position, there: Self::Position) -> u32;

    /// Whether a velocity node would read a WRITE of this position as standstill: 0 to
    /// 5e-10 rps (I11).
    fn is_still_as_velocity(position: Self::Position) -> bool;

    /// The addressed node, and the command in both readings.
    fn request(frame: <Self::ToSlave as Framing>::Frame<'_>) -> Heard<Self>;

    /// Same as [`request`](Self::request), on two wires; `None` for an answer of another node.
    fn packet(frame: <Self::BothDirections as Framing>::Frame<'_>) -> Option<Heard<Self>>;

    /// The responding node, and its status.
    fn response(frame: <Self::ToMaster as Framing>::Frame<'_>) -> (NodeId, Status<Self>)
    where
        Self: Board;
}

/// A request as a slave hears it: the addressed node and, for a WRITE, the command.
pub(crate) type Heard<B> = (NodeId, Option<Command<B>>);

/// The payload of a WRITE in its two readings: its bytes do not say which one was meant (ruling
/// I3).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Command<B: Packets> {
    /// Read as a speed.
    pub(crate) velocity: B::RawVelocity,
    /// Read as a position.
    pub(crate) position: B::Position,
}

/// Longest packet of either kind of board, bytes.
pub(super) const PACKET_LEN: usize = three::MAX_LEN;

/// Speed below which a motor counts as standing still, rps (I12).
const STILL_RPS: f32 = 0.05;

/// Whether these four bytes encode 0 to 5e-10 rps. Bit patterns of positive floats sort by value.
const fn is_still_on_wire(payload: [u8; 4]) -> bool {
    u32::from_le_bytes(payload) >> 16 <= 12_287
}

/// The target of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Target<B: Board = OneMotor> {
    /// A speed, revolutions per second.
    Velocity(B::Velocity),
    /// A position to go to.
    Position(B::Position),
}

impl<B: Board> Target<B> {
    /// The command that stops a velocity node.
    pub(crate) const STANDSTILL: Self = Self::Velocity(B::ZERO);

    /// The mode that this target is for.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        match self {
            Self::Velocity(_) => Mode::Velocity,
            Self::Position(_) => Mode::Position,
        }
    }

    /// The position; `None` for a speed.
    #[must_use]
    pub const fn position(&self) -> Option<B::Position> {
        match self {
            Self::Velocity(_) => None,
            Self::Position(position) => Some(*position),
        }
    }
}

/// A measurement of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status<B: Board = OneMotor> {
    /// Speed of a velocity node, revolutions per second: any `f32`.
    Velocity(B::RawVelocity),
    /// Position of a position node.
    Position(B::Position),
}

impl<B: Board> Status<B> {
    /// The mode that this status shows.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        match self {
            Self::Velocity(_) => Mode::Velocity,
            Self::Position(_) => Mode::Position,
        }
    }
}

/// Boards of the protocol document: one motor, 8-byte packets, a WRITE is not answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OneMotor {}

/// Boards found in the field with three motors: 16-byte packets, a WRITE is answered (ruling I10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThreeMotors {}

/// What the packets of both kinds of boards have in common: their types, in this module, and the
/// values in them.
macro_rules! packets {
    ($packets:ident, $positions:ident) => {
        type Write = $packets::WriteRequest;
        type VelocityResponse = $packets::VelocityResponse;
        type PositionResponse = $packets::PositionResponse;
        type ToSlave = $packets::ToSlave;
        type ToMaster = $packets::ToMaster;
        type BothDirections = $packets::BothDirections;

        fn write_velocity(id: NodeId, target: Self::Velocity) -> Self::Write {
            $packets::WriteRequest::velocity(id, target)
        }

        fn write_position(id: NodeId, target: Self::Position) -> Self::Write {
            $packets::WriteRequest::position(id, target)
        }

        fn velocity_response(id: NodeId, current: Self::Velocity) -> Self::VelocityResponse {
            $packets::VelocityResponse::new(id, current)
        }

        fn position_response(id: NodeId, current: Self::Position) -> Self::PositionResponse {
            $packets::PositionResponse::new(id, current)
        }

        fn request(frame: $packets::Request<'_>) -> Heard<Self> {
            match frame {
                $packets::Request::Read(read) => (read.id(), None),
                $packets::Request::Write(write) => {
                    let (velocity, position) = (write.as_velocity(), write.as_position());
                    (write.id(), Some(Command { velocity, position }))
                }
            }
        }

        fn packet(frame: $packets::Packet<'_>) -> Option<Heard<Self>> {
            match frame {
                $packets::Packet::Request(request) => Some(Self::request(request)),
                $packets::Packet::Response(_) => None,
            }
        }

        fn response(frame: $packets::Response<'_>) -> (NodeId, Status<Self>) {
            match frame {
                $packets::Response::Velocity(it) => (it.id(), Status::Velocity(it.rps())),
                $packets::Response::Position(it) => (it.id(), Status::Position(it.$positions())),
            }
        }
    };
}

impl Units for OneMotor {
    type Velocity = Rps;
    type RawVelocity = f32;
    type Position = Position;

    const ZERO: Rps = Rps::ZERO;
    const ANSWERS_WRITE: bool = false;
}

impl Packets for OneMotor {
    packets!(one, position);

    fn finite(raw: f32) -> Option<Rps> {
        Rps::new(raw).ok()
    }

    fn is_still(speed: f32) -> bool {
        speed.abs() < STILL_RPS
    }

    fn distance(here: Position, there: Position) -> u32 {
        here.counts().abs_diff(there.counts())
    }

    fn is_still_as_velocity(position: Position) -> bool {
        is_still_on_wire(position.to_le_bytes())
    }
}

impl Units for ThreeMotors {
    type Velocity = [Rps; 3];
    type RawVelocity = [f32; 3];
    type Position = [Position; 3];

    const ZERO: [Rps; 3] = [Rps::ZERO; 3];
    const ANSWERS_WRITE: bool = true;
}

impl Packets for ThreeMotors {
    packets!(three, positions);

    fn finite([a, b, c]: [f32; 3]) -> Option<[Rps; 3]> {
        Some([Rps::new(a).ok()?, Rps::new(b).ok()?, Rps::new(c).ok()?])
    }

    fn is_still(speeds: [f32; 3]) -> bool {
        speeds.into_iter().all(OneMotor::is_still)
    }

    fn distance(here: [Position; 3], there: [Position; 3]) -> u32 {
        let ways = here.into_iter().zip(there).map(|(here, there)| OneMotor::distance(here, there));
        ways.fold(0, u32::max)
    }

    fn is_still_as_velocity(positions: [Position; 3]) -> bool {
        // The speed of one motor takes the bytes of several positions, so build the packet.
        let write = three::WriteRequest::position(NodeId::N1, positions);
        write.as_velocity().into_iter().all(|speed| is_still_on_wire(speed.to_le_bytes()))
    }
}
