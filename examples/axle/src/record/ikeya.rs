//! Packets of the motor bus, with one or three motors per board.

use axlewire::ikeya::{
    NodeId, Packet, Position, PositionResponse, ReadRequest, Request, Response, VelocityResponse,
    three,
};
use serde::{Serialize, Serializer, ser::SerializeStruct};

use super::Hex;

/// One packet.
#[derive(Debug, Serialize)]
pub(crate) struct Frame<'a> {
    pub(crate) length: usize,
    pub(crate) protocol: &'static str,
    pub(crate) message: &'static str,
    pub(crate) node: NodeId,
    #[serde(flatten)]
    pub(crate) fields: Fields<'a>,
}

/// Contents of a packet.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Fields<'a> {
    Read {},
    /// Both readings, because the bytes do not distinguish a speed from a position (ruling I3).
    Write {
        rps: Motors<Rps>,
        #[serde(flatten)]
        positions: Positions,
        payload: Hex<'a>,
    },
    Velocity {
        rps: Motors<Rps>,
    },
    Position(Positions),
}

/// One value, or one for each of three motors.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Motors<T> {
    One(T),
    Three([T; 3]),
}

impl<T> Motors<T> {
    /// Applies `change` to each value.
    pub(crate) fn map<U>(self, change: impl FnMut(T) -> U) -> Motors<U> {
        let mut change = change;
        match self {
            Self::One(value) => Motors::One(change(value)),
            Self::Three(values) => Motors::Three(values.map(change)),
        }
    }
}

/// Revolutions per second; JSON has no number for NaN and infinities, so they are strings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rps(pub(crate) f32);

impl Serialize for Rps {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            rps if rps.is_nan() => serializer.serialize_str("nan"),
            f32::INFINITY => serializer.serialize_str("inf"),
            f32::NEG_INFINITY => serializer.serialize_str("-inf"),
            rps => serializer.serialize_f32(rps),
        }
    }
}

/// Shaft positions; as on the wire, all counts precede all rotations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Positions(pub(crate) Motors<Position>);

impl Serialize for Positions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Positions", 2)?;
        fields.serialize_field("count", &self.0.map(Position::count))?;
        fields.serialize_field("rotation", &self.0.map(Position::rotation))?;
        fields.end()
    }
}

const ONE: &str = "ikeya";
const THREE: &str = "ikeya-3";

fn read(protocol: &'static str, packet: &ReadRequest) -> Frame<'static> {
    Frame {
        length: ReadRequest::LEN,
        protocol,
        message: "read_request",
        node: packet.id(),
        fields: Fields::Read {},
    }
}

fn write<'a>(
    protocol: &'static str,
    packet: &'a [u8],
    node: NodeId,
    rps: Motors<f32>,
    positions: Motors<Position>,
) -> Frame<'a> {
    let payload = match packet {
        [_, _, payload @ .., _, _] => payload,
        _ => &[],
    };
    let fields =
        Fields::Write { rps: rps.map(Rps), positions: Positions(positions), payload: Hex(payload) };
    Frame { length: packet.len(), protocol, message: "write", node, fields }
}

fn velocity(
    protocol: &'static str,
    length: usize,
    node: NodeId,
    rps: Motors<f32>,
) -> Frame<'static> {
    let fields = Fields::Velocity { rps: rps.map(Rps) };
    Frame { length, protocol, message: "velocity_response", node, fields }
}

fn position(
    protocol: &'static str,
    length: usize,
    node: NodeId,
    positions: Motors<Position>,
) -> Frame<'static> {
    let fields = Fields::Position(Positions(positions));
    Frame { length, protocol, message: "position_response", node, fields }
}

impl<'a> From<Request<'a>> for super::Frame<'a> {
    fn from(request: Request<'a>) -> Self {
        Self::Ikeya(match request {
            Request::Read(packet) => read(ONE, packet),
            Request::Write(packet) => write(
                ONE,
                packet.as_bytes(),
                packet.id(),
                Motors::One(packet.as_velocity()),
                Motors::One(packet.as_position()),
            ),
        })
    }
}

impl<'a> From<Response<'a>> for super::Frame<'a> {
    fn from(response: Response<'a>) -> Self {
        Self::Ikeya(match response {
            Response::Velocity(packet) => {
                velocity(ONE, VelocityResponse::LEN, packet.id(), Motors::One(packet.rps()))
            }
            Response::Position(packet) => {
                position(ONE, PositionResponse::LEN, packet.id(), Motors::One(packet.position()))
            }
        })
    }
}

impl<'a> From<Packet<'a>> for super::Frame<'a> {
    fn from(packet: Packet<'a>) -> Self {
        match packet {
            Packet::Request(request) => request.into(),
            Packet::Response(response) => response.into(),
        }
    }
}

impl<'a> From<three::Request<'a>> for super::Frame<'a> {
    fn from(request: three::Request<'a>) -> Self {
        Self::Ikeya(match request {
            three::Request::Read(packet) => read(THREE, packet),
            three::Request::Write(packet) => write(
                THREE,
                packet.as_bytes(),
                packet.id(),
                Motors::Three(packet.as_velocity()),
                Motors::Three(packet.as_position()),
            ),
        })
    }
}

impl<'a> From<three::Response<'a>> for super::Frame<'a> {
    fn from(response: three::Response<'a>) -> Self {
        Self::Ikeya(match response {
            three::Response::Velocity(packet) => velocity(
                THREE,
                three::VelocityResponse::LEN,
                packet.id(),
                Motors::Three(packet.rps()),
            ),
            three::Response::Position(packet) => position(
                THREE,
                three::PositionResponse::LEN,
                packet.id(),
                Motors::Three(packet.positions()),
            ),
        })
    }
}

impl<'a> From<three::Packet<'a>> for super::Frame<'a> {
    fn from(packet: three::Packet<'a>) -> Self {
        match packet {
            three::Packet::Request(request) => request.into(),
            three::Packet::Response(response) => response.into(),
        }
    }
}
