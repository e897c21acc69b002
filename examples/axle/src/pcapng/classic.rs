//! Classic pcap: the format before pcapng, which `tcpdump` and older adapters write.
//!
//! A header of 24 bytes, then the packets, each behind 16 bytes with its time and its lengths. It
//! knows one interface and no directions. Format: draft-ietf-opsawg-pcap.

/// How a capture is coded, by its first four bytes.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Classic {
    pub(super) is_big_endian: bool,
    /// Unit of the fractions of a second, as an option of pcapng codes it.
    pub(super) unit: u8,
}

impl Classic {
    /// Of the first four bytes, read in little-endian order; `None` if it is no classic capture.
    pub(super) const fn of(magic: u32) -> Option<Self> {
        let (is_big_endian, unit) = match magic {
            0xA1B2_C3D4 => (false, 6),
            0xD4C3_B2A1 => (true, 6),
            0xA1B2_3C4D => (false, 9),
            0x4D3C_B2A1 => (true, 9),
            _ => return None,
        };
        Some(Self { is_big_endian, unit })
    }
}

/// Whether a capture begins with these bytes, classic or pcapng.
pub(crate) fn is_capture(first: &[u8]) -> bool {
    first.first_chunk().is_some_and(|&magic| {
        magic == super::format::MAGIC || Classic::of(u32::from_le_bytes(magic)).is_some()
    })
}
