//! The four packets of the standard bus, in the order of the protocol document.

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::units::{NodeId, Position, Rps};
use crate::{crc16, error::ParseError};

/// Headers, each an enum of one variant: any other byte makes an invalid packet.
pub(super) mod header {
    use super::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

    pub(crate) const READ: u8 = Read::Value as u8;
    pub(crate) const WRITE: u8 = Write::Value as u8;
    pub(crate) const VELOCITY: u8 = Velocity::Value as u8;
    pub(crate) const POSITION: u8 = Position::Value as u8;

    macro_rules! header {
        ($name:ident = $value:tt) => {
            #[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
            #[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
            #[cfg_attr(
                feature = "bytemuck",
                derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit)
            )]
            #[cfg_attr(feature = "defmt", derive(defmt::Format))]
            #[repr(u8)]
            pub(crate) enum $name {
                Value = $value,
            }
        };
    }

    header!(Read = 0xAA);
    header!(Write = 0xBB);
    header!(Velocity = 0x55);
    header!(Position = 0x56);
}

/// Master to slave, asks for the status: `AA | id | crc: u16`, 4 bytes, 80 µs at 500 kbit/s.
///
/// Every value has a valid header and id. A value from [`new`](Self::new), [`parse`](Self::parse)
/// or a decoder also has a valid CRC; a raw zerocopy or bytemuck cast does not check it.
///
/// ```
/// use axlewire::ikeya::{NodeId, ReadRequest};
/// assert_eq!(ReadRequest::new(NodeId::N1).as_bytes(), &[0xAA, 0x01, 0xBE, 0xD0]);
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct ReadRequest {
    header: header::Read,
    id: NodeId,
    crc: [u8; 2],
}

impl ReadRequest {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Asks node `id` for its status.
    #[must_use]
    pub fn new(id: NodeId) -> Self {
        Self { header: header::Read::Value, id, crc: [0; 2] }.sealed()
    }

    /// The addressed node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }
}

/// Master to slave, commands a motor: `BB | id | payload: 4 bytes | crc: u16`, 8 bytes, 160 µs at
/// 500 kbit/s. It is not answered (ruling I3).
///
/// The bytes do not say whether the payload is a speed or a position: the slave reads it according
/// to its DIP switch, so you must know the node's [`Mode`](super::Mode) to choose between the two
/// constructors and between the two readings. Read as a position, 1.0 rps is 16,256 turns.
///
/// Every value has a valid header and id. A value from a constructor, [`parse`](Self::parse) or a
/// decoder also has a valid CRC; a raw zerocopy or bytemuck cast does not check it.
///
/// ```
/// use axlewire::ikeya::{NodeId, Position, Rps, WriteRequest};
///
/// let turn = WriteRequest::velocity(NodeId::N1, Rps::new(1.0)?);
/// assert_eq!(turn.as_bytes(), &[0xBB, 0x01, 0x00, 0x00, 0x80, 0x3F, 0x07, 0x40]);
/// assert_eq!(turn.as_position().rotation(), 16_256); // what a position node would make of it
///
/// let go = WriteRequest::position(NodeId::N6, Position::new(4096, 1));
/// assert_eq!(go.as_bytes(), &[0xBB, 0x06, 0x00, 0x10, 0x01, 0x00, 0x93, 0x05]);
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
    payload: [u8; 4],
    crc: [u8; 2],
}

impl WriteRequest {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Commands node `id`, which must be in velocity mode, to turn at `target`.
    #[must_use]
    pub fn velocity(id: NodeId, target: Rps) -> Self {
        Self::new(id, target.get().to_le_bytes())
    }

    /// Commands node `id`, which must be in position mode, to go to `target`.
    #[must_use]
    pub fn position(id: NodeId, target: Position) -> Self {
        Self::new(id, target.to_le_bytes())
    }

    fn new(id: NodeId, payload: [u8; 4]) -> Self {
        Self { header: header::Write::Value, id, payload, crc: [0; 2] }.sealed()
    }

    /// The addressed node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// The payload read as a speed, revolutions per second: any `f32`, NaN and infinities included.
    #[must_use]
    pub const fn as_velocity(&self) -> f32 {
        f32::from_le_bytes(self.payload)
    }

    /// The payload read as a position.
    #[must_use]
    pub const fn as_position(&self) -> Position {
        Position::from_le_bytes(self.payload)
    }

    /// The payload as on the wire.
    #[must_use]
    pub const fn payload(&self) -> [u8; 4] {
        self.payload
    }
}

/// Slave to master, status of a velocity node: `55 | id | rps: f32 | crc: u16`, 8 bytes, 160 µs at
/// 500 kbit/s.
///
/// Every value has a valid header and id. A value from [`new`](Self::new), [`parse`](Self::parse)
/// or a decoder also has a valid CRC; a raw zerocopy or bytemuck cast does not check it.
///
/// ```
/// use axlewire::ikeya::{NodeId, VelocityResponse};
///
/// let response = VelocityResponse::parse(&[0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E])?;
/// assert_eq!((response.id(), response.rps()), (NodeId::N2, 1.0));
/// # Ok::<(), axlewire::error::ParseError>(())
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct VelocityResponse {
    header: header::Velocity,
    id: NodeId,
    rps: [u8; 4],
    crc: [u8; 2],
}

impl VelocityResponse {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Reports that node `id` turns at `current`.
    #[must_use]
    pub fn new(id: NodeId, current: Rps) -> Self {
        let rps = current.get().to_le_bytes();
        Self { header: header::Velocity::Value, id, rps, crc: [0; 2] }.sealed()
    }

    /// The responding node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// Speed, revolutions per second: any `f32`, NaN and infinities included.
    #[must_use]
    pub const fn rps(&self) -> f32 {
        f32::from_le_bytes(self.rps)
    }
}

/// Slave to master, status of a position node: `56 | id | count: i16 | rotation: i16 | crc: u16`,
/// 8 bytes, 160 µs at 500 kbit/s.
///
/// Every value has a valid header and id. A value from [`new`](Self::new), [`parse`](Self::parse)
/// or a decoder also has a valid CRC; a raw zerocopy or bytemuck cast does not check it.
///
/// ```
/// use axlewire::ikeya::{NodeId, Position, PositionResponse};
///
/// let response = PositionResponse::new(NodeId::N3, Position::new(4096, 1));
/// assert_eq!(response.as_bytes(), &[0x56, 0x03, 0x00, 0x10, 0x01, 0x00, 0x48, 0x78]);
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct PositionResponse {
    header: header::Position,
    id: NodeId,
    position: [u8; 4],
    crc: [u8; 2],
}

impl PositionResponse {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Reports that node `id` is at `current`.
    #[must_use]
    pub fn new(id: NodeId, current: Position) -> Self {
        let position = current.to_le_bytes();
        Self { header: header::Position::Value, id, position, crc: [0; 2] }.sealed()
    }

    /// The responding node.
    #[must_use]
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// Shaft position.
    #[must_use]
    pub const fn position(&self) -> Position {
        Position::from_le_bytes(self.position)
    }
}

/// Common to all packets of both variants: parsing, encoding, and `{:?}` with these values.
/// Encoding refuses NaN and infinity in speeds that are `finite`: a packet that was received may
/// hold them.
macro_rules! packet {
    ($($packet:ident { $($name:ident: $getter:ident),+ } $([finite $it:ident => $speeds:expr])?)+) => {$(
        impl core::fmt::Debug for $packet {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.debug_struct(stringify!($packet))
                    $(.field(stringify!($name), &self.$getter()))+
                    .finish()
            }
        }

        impl $packet {
            /// Borrows `bytes` as this packet.
            ///
            /// # Errors
            ///
            /// [`ParseError::Field`](crate::error::ParseError::Field) for another header or an id
            /// outside 1..=8, otherwise [`ParseError::Crc`](crate::error::ParseError::Crc).
            pub fn parse(bytes: &[u8; Self::LEN]) -> Result<&Self, $crate::error::ParseError> {
                super::wire::parsed(bytes)
            }

            /// The packet as bytes on the wire.
            #[must_use]
            pub fn as_bytes(&self) -> &[u8; Self::LEN] {
                zerocopy::transmute_ref!(self)
            }

            /// The same packet with its CRC filled in.
            fn sealed(self) -> Self {
                Self { crc: $crate::crc16::seal(self.as_bytes()), ..self }
            }
        }

        impl $crate::encode::Encode for $packet {
            fn encoded_len(&self) -> usize {
                Self::LEN
            }

            fn encode<'b>(
                &self,
                buffer: &'b mut [u8],
            ) -> Result<&'b [u8], $crate::error::EncodeError> {
                $(
                    let $it = self;
                    for rps in $speeds {
                        $crate::ikeya::Rps::new(rps)?;
                    }
                )?
                $crate::encode::encode_bytes(self.as_bytes(), buffer)
            }
        }
    )+};
}
pub(super) use packet;

packet! {
    ReadRequest { id: id }
    WriteRequest { id: id, velocity: as_velocity, position: as_position }
    VelocityResponse { id: id, rps: rps } [finite it => [it.rps()]]
    PositionResponse { id: id, position: position }
}

/// Borrows `bytes` as a packet if header, id and CRC are valid.
pub(super) fn parsed<P>(bytes: &[u8]) -> Result<&P, ParseError>
where
    P: TryFromBytes + Immutable + KnownLayout + Unaligned,
{
    let packet = P::try_ref_from_bytes(bytes).map_err(|_| ParseError::Field)?;
    crc16::verify(bytes)?;
    Ok(packet)
}

/// Views a judged packet as its type.
#[inline(always)]
pub(super) fn view<P>(frame: &[u8]) -> Option<&P>
where
    P: TryFromBytes + Immutable + KnownLayout + Unaligned,
{
    P::try_ref_from_bytes(frame).ok()
}
