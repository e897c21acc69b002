//! Three-motor boards found in the field (ruling I10): the same bus with 16-byte packets.
//!
//! ```text
//! READ      AA | id | crc                                                    4 bytes
//! WRITE     BB | id | 3 × f32, or 3 × count then 3 × rotation | crc         16 bytes
//! velocity  55 | id | 3 × f32 | crc                                         16 bytes
//! position  56 | id | 3 × count: i16, then 3 × rotation: i16 | crc          16 bytes
//! ```
//!
//! Their packets have the same headers as the standard 8-byte packets, so the headers do not tell
//! the two apart: to choose a decoder, you must know which boards are on the bus. Here a WRITE *is*
//! answered, with the same status packet as a READ.

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

pub use super::wire::ReadRequest;
use super::{
    framing::framings,
    units::{NodeId, Position, Rps},
    wire::{header, packet},
};

// Without batches: captures of such a bus are small.
framings! { accept_batch: |_| 0 }

/// Master to slave, commands three motors at once: 16 bytes, 320 µs at 500 kbit/s.
///
/// As with the [standard packet](super::WriteRequest), you must know the node's mode to choose
/// between the two constructors and between the two readings.
///
/// ```
/// use axlewire::ikeya::{NodeId, Rps, three::WriteRequest};
///
/// let packet = WriteRequest::velocity(NodeId::N1, [Rps::new(1.5)?, Rps::ZERO, Rps::ZERO]);
/// assert_eq!(packet.as_bytes()[..6], [0xBB, 0x01, 0x00, 0x00, 0xC0, 0x3F]);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct WriteRequest {
    header: header::Write,
    id: NodeId,
    payload: [[u8; 4]; 3],
    crc: [u8; 2],
}

impl WriteRequest {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Commands the motors of node `id`, which must be in velocity mode.
    #[must_use]
    pub fn velocity(id: NodeId, targets: [Rps; 3]) -> Self {
        let payload = targets.map(|target| target.get().to_le_bytes());
        Self { header: header::Write::Value, id, payload, crc: [0; 2] }.sealed()
    }

    /// Commands the motors of node `id`, which must be in position mode.
    #[must_use]
    pub fn position(id: NodeId, targets: [Position; 3]) -> Self {
        let payload = positions_to_wire(targets);
        Self { header: header::Write::Value, id, payload, crc: [0; 2] }.sealed()
    }

    /// The addressed node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// The payload read as three speeds, revolutions per second, NaN and infinities included.
    #[must_use]
    pub fn as_velocity(&self) -> [f32; 3] {
        self.payload.map(f32::from_le_bytes)
    }

    /// The payload read as three positions.
    #[must_use]
    pub fn as_position(&self) -> [Position; 3] {
        positions_from_wire(self.payload)
    }

    /// The payload as on the wire, in groups of four bytes.
    #[must_use]
    pub const fn payload(&self) -> [[u8; 4]; 3] {
        self.payload
    }
}

/// Slave to master, status of a velocity node with three motors: 16 bytes.
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct VelocityResponse {
    header: header::Velocity,
    id: NodeId,
    rps: [[u8; 4]; 3],
    crc: [u8; 2],
}

impl VelocityResponse {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Reports that the motors of node `id` turn at `current`.
    #[must_use]
    pub fn new(id: NodeId, current: [Rps; 3]) -> Self {
        let rps = current.map(|rps| rps.get().to_le_bytes());
        Self { header: header::Velocity::Value, id, rps, crc: [0; 2] }.sealed()
    }

    /// The responding node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// Speeds, revolutions per second, NaN and infinities included.
    #[must_use]
    pub fn rps(&self) -> [f32; 3] {
        self.rps.map(f32::from_le_bytes)
    }
}

/// Slave to master, status of a position node with three motors: 16 bytes.
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct PositionResponse {
    header: header::Position,
    id: NodeId,
    positions: [[u8; 4]; 3],
    crc: [u8; 2],
}

impl PositionResponse {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Reports that the motors of node `id` are at `current`.
    #[must_use]
    pub fn new(id: NodeId, current: [Position; 3]) -> Self {
        let positions = positions_to_wire(current);
        Self { header: header::Position::Value, id, positions, crc: [0; 2] }.sealed()
    }

    /// The responding node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// Shaft positions.
    #[must_use]
    pub fn positions(&self) -> [Position; 3] {
        positions_from_wire(self.positions)
    }
}

packet! {
    WriteRequest { id: id, velocity: as_velocity, position: as_position }
    VelocityResponse { id: id, rps: rps } [finite it => it.rps()]
    PositionResponse { id: id, positions: positions }
}

/// Three counts, then three rotations: not three pairs.
fn positions_to_wire([a, b, c]: [Position; 3]) -> [[u8; 4]; 3] {
    zerocopy::transmute!([
        a.count().to_le_bytes(),
        b.count().to_le_bytes(),
        c.count().to_le_bytes(),
        a.rotation().to_le_bytes(),
        b.rotation().to_le_bytes(),
        c.rotation().to_le_bytes(),
    ])
}

fn positions_from_wire(payload: [[u8; 4]; 3]) -> [Position; 3] {
    let fields: [[u8; 2]; 6] = zerocopy::transmute!(payload);
    let [count_a, count_b, count_c, rotation_a, rotation_b, rotation_c] =
        fields.map(i16::from_le_bytes);
    [
        Position::new(count_a, rotation_a),
        Position::new(count_b, rotation_b),
        Position::new(count_c, rotation_c),
    ]
}
