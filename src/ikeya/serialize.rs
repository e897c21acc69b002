//! Packets as data for `serde`: flat maps with the fields of `axle decode --json`.

use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{
    board::{OneMotor, Status, ThreeMotors},
    contents::{Motors, Values},
    fields::{COUNT, NODE, PAYLOAD, ROTATION, RPS},
    framing::{Packet, Request, Response},
    three::{Packet as PacketOfThree, Request as RequestOfThree, Response as ResponseOfThree},
    units::{NodeId, Position},
};
use crate::{
    map::Fields,
    record::{BYTES, LENGTH, MESSAGE, PROTOCOL},
    text::Hex,
};

/// What the packets of both kinds of boards have in common.
struct Parts<'a> {
    protocol: &'static str,
    message: &'static str,
    node: NodeId,
    values: Values,
    bytes: &'a [u8],
}

macro_rules! serialized {
    ($($protocol:literal: $($packet:ident),+;)+) => {$($(
        /// A map: `length`, `protocol`, `message`, `node`, the values, and `bytes`: the whole
        /// packet in lower-case hex digits. The page `fields` describes each.
        impl Serialize for $packet<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                Parts {
                    protocol: $protocol,
                    message: self.name(),
                    node: self.id(),
                    values: self.values(),
                    bytes: self.as_bytes(),
                }
                .as_map(serializer)
            }
        }
    )+)+};
}

serialized! {
    "ikeya": Request, Response, Packet;
    "ikeya-3": RequestOfThree, ResponseOfThree, PacketOfThree;
}

impl Fields for Parts<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry(LENGTH.name, &self.bytes.len())?;
        map.serialize_entry(PROTOCOL.name, self.protocol)?;
        map.serialize_entry(MESSAGE.name, self.message)?;
        map.serialize_entry(NODE.name, &self.node)?;
        self.values.put(map)?;
        if let (Values::Command(..), [_, _, payload @ .., _, _]) = (&self.values, self.bytes) {
            map.serialize_entry(PAYLOAD.name, &Hex(payload))?;
        }
        map.serialize_entry(BYTES.name, &Hex(self.bytes))
    }
}

/// A map: `rps`, or `count` and `rotation`, as in the JSON of a response.
impl Serialize for Status<OneMotor> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = match *self {
            Self::Velocity(speed) => Values::Speeds(speed.into()),
            Self::Position(position) => Values::Positions(position.into()),
        };
        values.as_map(serializer)
    }
}

/// The same with three values each.
impl Serialize for Status<ThreeMotors> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = match *self {
            Self::Velocity(speeds) => Values::Speeds(speeds.into()),
            Self::Position(positions) => Values::Positions(positions.into()),
        };
        values.as_map(serializer)
    }
}

impl Fields for Values {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        match self {
            Self::None => Ok(()),
            Self::Command(speed, position) => {
                map.serialize_entry(RPS.name, &Speeds(speed))?;
                positions(position, map)
            }
            Self::Speeds(speed) => map.serialize_entry(RPS.name, &Speeds(speed)),
            Self::Positions(position) => positions(position, map),
        }
    }
}

/// As on the wire, all counts precede all rotations.
fn positions<M: SerializeMap>(positions: &Motors<Position>, map: &mut M) -> Result<(), M::Error> {
    match positions {
        Motors::One([position]) => {
            map.serialize_entry(COUNT.name, &position.count())?;
            map.serialize_entry(ROTATION.name, &position.rotation())
        }
        Motors::Three(positions) => {
            map.serialize_entry(COUNT.name, &positions.map(Position::count))?;
            map.serialize_entry(ROTATION.name, &positions.map(Position::rotation))
        }
    }
}

/// One speed or three.
struct Speeds<'a>(&'a Motors<f32>);

impl Serialize for Speeds<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Motors::One([speed]) => Speed(*speed).serialize(serializer),
            Motors::Three(speeds) => speeds.map(Speed).serialize(serializer),
        }
    }
}

/// Revolutions per second; JSON has no number for NaN and infinities, so they are strings.
struct Speed(f32);

impl Serialize for Speed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            rps if rps.is_nan() => serializer.serialize_str("nan"),
            f32::INFINITY => serializer.serialize_str("inf"),
            f32::NEG_INFINITY => serializer.serialize_str("-inf"),
            rps => serializer.serialize_f32(rps),
        }
    }
}
