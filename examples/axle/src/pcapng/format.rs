//! The numbers of the format, and what they mean here.

use crate::args::Protocol;

/// The first bytes of every file, in both byte orders.
pub(crate) const MAGIC: [u8; 4] = [0x0A, 0x0D, 0x0D, 0x0A];

/// Types of blocks.
pub(super) mod block {
    pub(crate) const SECTION: u32 = u32::from_le_bytes(super::MAGIC);
    pub(crate) const INTERFACE: u32 = 1;
    /// What old programs wrote instead of [`PACKET`]; its flags are the same.
    pub(crate) const OBSOLETE_PACKET: u32 = 2;
    pub(crate) const SIMPLE_PACKET: u32 = 3;
    pub(crate) const PACKET: u32 = 6;
}

/// Tells the byte order of a section.
pub(super) const BYTE_ORDER: u32 = 0x1A2B_3C4D;

/// Codes of options.
pub(super) mod option {
    pub(crate) const END: u16 = 0;
    pub(crate) const COMMENT: u16 = 1;
    pub(crate) const USER_APPLICATION: u16 = 4;
    pub(crate) const INTERFACE_NAME: u16 = 2;
    pub(crate) const INTERFACE_DESCRIPTION: u16 = 3;
    pub(crate) const SPEED: u16 = 8;
    pub(crate) const TIME_UNIT: u16 = 9;
    pub(crate) const TIME_OFFSET: u16 = 14;
    pub(crate) const FLAGS: u16 = 2;
}

/// Direction of a packet, as its flags say it.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) enum Direction {
    /// Received by the recording program.
    In,
    /// Sent by it.
    Out,
}

impl Direction {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::In => "in",
            Self::Out => "out",
        }
    }

    pub(super) const fn flags(self) -> u32 {
        match self {
            Self::In => 1,
            Self::Out => 2,
        }
    }

    pub(super) const fn from_flags(flags: u32) -> Option<Self> {
        match flags & 3 {
            1 => Some(Self::In),
            2 => Some(Self::Out),
            _ => None,
        }
    }
}

/// Link types for private use: USER0, USER1 and USER3. Wireshark takes USER2 for PKTAP.
pub(crate) const fn link_type(protocol: Protocol) -> u16 {
    match protocol {
        Protocol::Ikeya => 147,
        Protocol::Ikeya3 => 148,
        Protocol::Ucp => 150,
    }
}

/// UCP in captures of the first versions: USER2.
const OLD_UCP: u16 = 149;

/// The protocol of a link type; `None` for those of others.
pub(crate) fn protocol_of(link_type_found: u16) -> Option<Protocol> {
    if link_type_found == OLD_UCP {
        return Some(Protocol::Ucp);
    }
    [Protocol::Ikeya, Protocol::Ikeya3, Protocol::Ucp]
        .into_iter()
        .find(|&protocol| link_type(protocol) == link_type_found)
}
