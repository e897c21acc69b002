//! Packets of the motor bus.

use axlewire::{
    encode::Encode,
    ikeya::{self, Position, ReadRequest, Rps, three},
    stream::{Framing, Reason, Verdict},
};

use super::{axle_ikeya_position, node_from};
use crate::{
    memory::{Out, bytes, bytes_mut, read},
    result::{
        AXLE_ERROR_CRC, AXLE_ERROR_FIELD, AXLE_ERROR_LENGTH, AXLE_ERROR_NODE_ID, AXLE_ERROR_VALUE,
        axle_result, of_encode,
    },
};

/// A packet of a motor bus.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct axle_ikeya_packet {
    /// One of `AXLE_IKEYA_PACKET_`.
    pub kind: u8,
    /// Id of the slave, 1 to 8 (ruling I1).
    pub node: u8,
    /// Motors of the board, 1 or 3; of no matter for a READ, which is the same for both.
    pub motors: u8,
    /// Speeds, turns per second. A WRITE that was parsed has both readings: only the mode of the
    /// node, which is not in the packet, tells which one is meant (ruling I3).
    pub velocity_rps: [f32; 3],
    /// Positions.
    pub position: [axle_ikeya_position; 3],
}
plain!(axle_ikeya_packet);

kinds! {
    /// The name of a kind of packet, such as "read"; "?" for another number.
    axle_ikeya_packet_name: u8;
    /// READ: asks a slave for its status.
    AXLE_IKEYA_PACKET_READ = 1, c"read";
    /// WRITE, as parsed: commands a slave in velocity or position mode.
    AXLE_IKEYA_PACKET_WRITE = 2, c"write";
    /// WRITE of `velocity_rps`, for encoding.
    AXLE_IKEYA_PACKET_WRITE_VELOCITY = 3, c"write_velocity";
    /// WRITE of `position`, for encoding.
    AXLE_IKEYA_PACKET_WRITE_POSITION = 4, c"write_position";
    /// The answer of a slave in velocity mode.
    AXLE_IKEYA_PACKET_VELOCITY = 5, c"velocity";
    /// The answer of a slave in position mode.
    AXLE_IKEYA_PACKET_POSITION = 6, c"position";
}

/// Length of the longest packet, bytes.
pub const AXLE_IKEYA_PACKET_MAX_LENGTH: usize = 16;

const _: () = assert!(AXLE_IKEYA_PACKET_MAX_LENGTH == three::MAX_LEN);

/// Writes the packet with its CRC to `to`, which has room for `capacity` bytes, and its length.
///
/// Fails with `AXLE_ERROR_NODE_ID`, `AXLE_ERROR_NOT_FINITE`, `AXLE_ERROR_BUFFER_TOO_SMALL`, or
/// `AXLE_ERROR_VALUE` for an unknown kind or number of motors.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_encode(
    packet: *const axle_ikeya_packet,
    to: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> axle_result {
    let encode = || {
        let (packet, to, length) = (read(packet)?, bytes_mut(to, capacity)?, Out::new(length)?);
        Ok(length.write(encode(&packet, to)?))
    };
    encode().unwrap_or_else(|error| error)
}

fn encode(packet: &axle_ikeya_packet, to: &mut [u8]) -> Result<usize, axle_result> {
    let node = node_from(packet.node)?;
    let positions = packet.position.map(Position::from);
    let rps = || -> Result<[Rps; 3], axle_result> {
        let [a, b, c] = packet.velocity_rps.map(Rps::new);
        Ok([a.map_err(of_encode)?, b.map_err(of_encode)?, c.map_err(of_encode)?])
    };
    let first = || Rps::new(packet.velocity_rps[0]).map_err(of_encode);
    match (packet.kind, packet.motors) {
        (AXLE_IKEYA_PACKET_READ, _) => put(ReadRequest::new(node), to),
        (AXLE_IKEYA_PACKET_WRITE_VELOCITY, 1) => {
            put(ikeya::WriteRequest::velocity(node, first()?), to)
        }
        (AXLE_IKEYA_PACKET_WRITE_VELOCITY, 3) => {
            put(three::WriteRequest::velocity(node, rps()?), to)
        }
        (AXLE_IKEYA_PACKET_WRITE_POSITION, 1) => {
            put(ikeya::WriteRequest::position(node, positions[0]), to)
        }
        (AXLE_IKEYA_PACKET_WRITE_POSITION, 3) => {
            put(three::WriteRequest::position(node, positions), to)
        }
        (AXLE_IKEYA_PACKET_VELOCITY, 1) => put(ikeya::VelocityResponse::new(node, first()?), to),
        (AXLE_IKEYA_PACKET_VELOCITY, 3) => put(three::VelocityResponse::new(node, rps()?), to),
        (AXLE_IKEYA_PACKET_POSITION, 1) => {
            put(ikeya::PositionResponse::new(node, positions[0]), to)
        }
        (AXLE_IKEYA_PACKET_POSITION, 3) => put(three::PositionResponse::new(node, positions), to),
        _ => Err(AXLE_ERROR_VALUE),
    }
}

fn put(packet: impl Encode, to: &mut [u8]) -> Result<usize, axle_result> {
    packet.encode(to).map(<[u8]>::len).map_err(of_encode)
}

/// Reads a packet of exactly these bytes; of 16 bytes if its board has three motors.
///
/// Fails with `AXLE_ERROR_LENGTH`, `AXLE_ERROR_FIELD`, `AXLE_ERROR_NODE_ID` or `AXLE_ERROR_CRC`.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_parse(
    data: *const u8,
    length: usize,
    packet: *mut axle_ikeya_packet,
) -> axle_result {
    let parse = || {
        let (data, out) = (bytes(data, length)?, Out::new(packet)?);
        let packet = match length {
            three::MAX_LEN => {
                checked::<three::BothDirections>(data)?;
                three::BothDirections::view(data).map(of_three)
            }
            _ => {
                checked::<ikeya::BothDirections>(data)?;
                ikeya::BothDirections::view(data).map(of_one)
            }
        };
        Ok(packet.map_or(AXLE_ERROR_FIELD, |packet| out.write(packet)))
    };
    parse().unwrap_or_else(|error| error)
}

fn checked<F: Framing>(data: &[u8]) -> Result<(), axle_result> {
    match F::judge(data) {
        Verdict::Frame { len } if len == data.len() => Ok(()),
        Verdict::Frame { .. } | Verdict::Partial { .. } => Err(AXLE_ERROR_LENGTH),
        Verdict::Reject { reason: Reason::Crc, .. } => Err(AXLE_ERROR_CRC),
        Verdict::Reject { reason: Reason::Id, .. } => Err(AXLE_ERROR_NODE_ID),
        Verdict::Reject { .. } => Err(AXLE_ERROR_FIELD),
    }
}

fn of_one(packet: ikeya::Packet<'_>) -> axle_ikeya_packet {
    let (kind, velocity, position) = match packet {
        ikeya::Packet::Request(ikeya::Request::Read(_)) => {
            (AXLE_IKEYA_PACKET_READ, 0.0, Position::new(0, 0))
        }
        ikeya::Packet::Request(ikeya::Request::Write(write)) => {
            (AXLE_IKEYA_PACKET_WRITE, write.as_velocity(), write.as_position())
        }
        ikeya::Packet::Response(ikeya::Response::Velocity(answer)) => {
            (AXLE_IKEYA_PACKET_VELOCITY, answer.rps(), Position::new(0, 0))
        }
        ikeya::Packet::Response(ikeya::Response::Position(answer)) => {
            (AXLE_IKEYA_PACKET_POSITION, 0.0, answer.position())
        }
    };
    let position =
        [position.into(), axle_ikeya_position::default(), axle_ikeya_position::default()];
    let velocity_rps = [velocity, 0.0, 0.0];
    axle_ikeya_packet { kind, node: packet.id().get(), motors: 1, velocity_rps, position }
}

fn of_three(packet: three::Packet<'_>) -> axle_ikeya_packet {
    let none = [Position::new(0, 0); 3];
    let (kind, velocity_rps, position) = match packet {
        three::Packet::Request(three::Request::Read(_)) => (AXLE_IKEYA_PACKET_READ, [0.0; 3], none),
        three::Packet::Request(three::Request::Write(write)) => {
            (AXLE_IKEYA_PACKET_WRITE, write.as_velocity(), write.as_position())
        }
        three::Packet::Response(three::Response::Velocity(answer)) => {
            (AXLE_IKEYA_PACKET_VELOCITY, answer.rps(), none)
        }
        three::Packet::Response(three::Response::Position(answer)) => {
            (AXLE_IKEYA_PACKET_POSITION, [0.0; 3], answer.positions())
        }
    };
    let (node, position) = (packet.id().get(), position.map(Into::into));
    axle_ikeya_packet { kind, node, motors: 3, velocity_rps, position }
}
