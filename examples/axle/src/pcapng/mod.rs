//! Captures with times: the part of pcapng that a serial line needs.
//!
//! A file is a sequence of blocks: a section header, then one description per interface, then the
//! packets. What `axle record` writes: one section, one interface with the name of the port, the
//! protocol as its description, the baud rate as its speed and microseconds as its unit of time;
//! one packet per frame, and one or more per run of bytes between frames.
//!
//! Written by hand: of two crates for pcapng, one takes every unit of time for nanoseconds, the
//! other reads no binary units and no big-endian offsets, and to write files one pulls in a second
//! `syn`, the other `futures`. Format: draft-ietf-opsawg-pcapng.

mod background;
mod read;
mod recording;
mod write;

pub(crate) use background::Background;
pub(crate) use read::{Packet, Reader};
pub(crate) use recording::{Recording, Stamp};
pub(crate) use write::Writer;

use crate::args::Protocol;

/// The first bytes of every file, in both byte orders.
pub(crate) const MAGIC: [u8; 4] = [0x0A, 0x0D, 0x0D, 0x0A];

/// Types of blocks.
mod block {
    pub(super) const INTERFACE: u32 = 1;
    /// What old programs wrote instead of [`PACKET`]; its flags are the same.
    pub(super) const OBSOLETE_PACKET: u32 = 2;
    pub(super) const SIMPLE_PACKET: u32 = 3;
    pub(super) const PACKET: u32 = 6;
}

/// Tells the byte order of a section.
const BYTE_ORDER: u32 = 0x1A2B_3C4D;

/// Codes of options.
mod option {
    pub(super) const END: u16 = 0;
    pub(super) const USER_APPLICATION: u16 = 4;
    pub(super) const INTERFACE_NAME: u16 = 2;
    pub(super) const INTERFACE_DESCRIPTION: u16 = 3;
    pub(super) const SPEED: u16 = 8;
    pub(super) const TIME_UNIT: u16 = 9;
    pub(super) const TIME_OFFSET: u16 = 14;
    pub(super) const FLAGS: u16 = 2;
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

    const fn flags(self) -> u32 {
        match self {
            Self::In => 1,
            Self::Out => 2,
        }
    }

    const fn from_flags(flags: u32) -> Option<Self> {
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

#[cfg(test)]
mod tests;
