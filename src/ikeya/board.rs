//! The two kinds of boards, so that one master and one slave serve both.

use core::fmt;

use super::{Mode, NodeId, Position, Request, Response, Rps, WriteRequest, three};
use crate::stream::{Encode, Framing};

/// What a kind of board sends and understands (rulings I3, I10).
///
/// Implemented by [`OneMotor`] and [`ThreeMotors`] and by nothing else.
pub trait Board: sealed::Sealed + Copy + fmt::Debug + PartialEq + 'static {
    /// A target or current speed.
    type Velocity: Copy + fmt::Debug + PartialEq;
    /// A speed as a packet carries it: any bits.
    type RawVelocity: Copy + fmt::Debug + PartialEq;
    /// A target or current position.
    type Position: Copy + fmt::Debug + PartialEq;
    /// A WRITE packet.
    type Write: Encode;
    /// A velocity response.
    type VelocityResponse: Encode;
    /// A position response.
    type PositionResponse: Encode;
    /// What slaves hear.
    type ToSlave: Framing;
    /// What the master hears.
    type ToMaster: Framing;

    /// Standing still.
    const ZERO: Self::Velocity;

    /// Whether a WRITE is answered with the status.
    const ANSWERS_WRITE: bool;

    /// A WRITE for a velocity node.
    fn write_velocity(id: NodeId, target: Self::Velocity) -> Self::Write;

    /// A WRITE for a position node.
    fn write_position(id: NodeId, target: Self::Position) -> Self::Write;

    /// The answer of a velocity node.
    fn velocity_response(id: NodeId, current: Self::Velocity) -> Self::VelocityResponse;

    /// The answer of a position node.
    fn position_response(id: NodeId, current: Self::Position) -> Self::PositionResponse;

    /// The speed that was meant; `None` where it is no number.
    fn finite(raw: Self::RawVelocity) -> Option<Self::Velocity>;

    /// Who is asked, and what is commanded in either reading.
    fn request(frame: <Self::ToSlave as Framing>::Frame<'_>) -> (NodeId, Option<Command<Self>>);

    /// Who answers, and what.
    fn response(frame: <Self::ToMaster as Framing>::Frame<'_>) -> (NodeId, Status<Self>);
}

mod sealed {
    /// Keeps `Board` to this crate.
    pub trait Sealed {}
    impl Sealed for super::OneMotor {}
    impl Sealed for super::ThreeMotors {}
}

/// The payload of a WRITE in its two readings: its bytes do not say which was meant (ruling I3).
#[derive(Clone, Copy, Debug)]
pub struct Command<B: Board> {
    /// Read as a speed.
    pub velocity: B::RawVelocity,
    /// Read as a position.
    pub position: B::Position,
}

/// What a motor is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target<B: Board = OneMotor> {
    /// Turn, revolutions per second.
    Velocity(B::Velocity),
    /// Go there.
    Position(B::Position),
}

/// What a node measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Status<B: Board> {
    /// Of a velocity node, revolutions per second: any `f32`.
    Velocity(B::RawVelocity),
    /// Of a position node.
    Position(B::Position),
}

impl<B: Board> Status<B> {
    /// The mode that such a status tells.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        match self {
            Self::Velocity(_) => Mode::Velocity,
            Self::Position(_) => Mode::Position,
        }
    }
}

/// Boards as in the protocol document: one motor, 8-byte packets, a WRITE is not answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OneMotor {}

/// Boards of the field with three motors: 16-byte packets, a WRITE is answered (ruling I10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThreeMotors {}

impl Board for OneMotor {
    type Velocity = Rps;
    type RawVelocity = f32;
    type Position = Position;
    type Write = WriteRequest;
    type VelocityResponse = super::VelocityResponse;
    type PositionResponse = super::PositionResponse;
    type ToSlave = super::ToSlave;
    type ToMaster = super::ToMaster;

    const ZERO: Rps = Rps::ZERO;
    const ANSWERS_WRITE: bool = false;

    fn write_velocity(id: NodeId, target: Rps) -> WriteRequest {
        WriteRequest::velocity(id, target)
    }

    fn write_position(id: NodeId, target: Position) -> WriteRequest {
        WriteRequest::position(id, target)
    }

    fn velocity_response(id: NodeId, current: Rps) -> super::VelocityResponse {
        super::VelocityResponse::new(id, current)
    }

    fn position_response(id: NodeId, current: Position) -> super::PositionResponse {
        super::PositionResponse::new(id, current)
    }

    fn finite(raw: f32) -> Option<Rps> {
        Rps::new(raw).ok()
    }

    fn request(frame: Request<'_>) -> (NodeId, Option<Command<Self>>) {
        match frame {
            Request::Read(read) => (read.id(), None),
            Request::Write(write) => {
                let (velocity, position) = (write.as_velocity(), write.as_position());
                (write.id(), Some(Command { velocity, position }))
            }
        }
    }

    fn response(frame: Response<'_>) -> (NodeId, Status<Self>) {
        match frame {
            Response::Velocity(response) => (response.id(), Status::Velocity(response.rps())),
            Response::Position(response) => (response.id(), Status::Position(response.position())),
        }
    }
}

impl Board for ThreeMotors {
    type Velocity = [Rps; 3];
    type RawVelocity = [f32; 3];
    type Position = [Position; 3];
    type Write = three::WriteRequest;
    type VelocityResponse = three::VelocityResponse;
    type PositionResponse = three::PositionResponse;
    type ToSlave = three::ToSlave;
    type ToMaster = three::ToMaster;

    const ZERO: [Rps; 3] = [Rps::ZERO; 3];
    const ANSWERS_WRITE: bool = true;

    fn write_velocity(id: NodeId, target: [Rps; 3]) -> three::WriteRequest {
        three::WriteRequest::velocity(id, target)
    }

    fn write_position(id: NodeId, target: [Position; 3]) -> three::WriteRequest {
        three::WriteRequest::position(id, target)
    }

    fn velocity_response(id: NodeId, current: [Rps; 3]) -> three::VelocityResponse {
        three::VelocityResponse::new(id, current)
    }

    fn position_response(id: NodeId, current: [Position; 3]) -> three::PositionResponse {
        three::PositionResponse::new(id, current)
    }

    fn finite([a, b, c]: [f32; 3]) -> Option<[Rps; 3]> {
        Some([Rps::new(a).ok()?, Rps::new(b).ok()?, Rps::new(c).ok()?])
    }

    fn request(frame: three::Request<'_>) -> (NodeId, Option<Command<Self>>) {
        match frame {
            three::Request::Read(read) => (read.id(), None),
            three::Request::Write(write) => {
                let (velocity, position) = (write.as_velocity(), write.as_position());
                (write.id(), Some(Command { velocity, position }))
            }
        }
    }

    fn response(frame: three::Response<'_>) -> (NodeId, Status<Self>) {
        match frame {
            three::Response::Velocity(it) => (it.id(), Status::Velocity(it.rps())),
            three::Response::Position(it) => (it.id(), Status::Position(it.positions())),
        }
    }
}
