//! Writes a capture.

use super::format::{BYTE_ORDER, Direction, MAGIC, block, link_type, option};
use crate::args::Protocol;

/// Writes blocks into memory.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    /// Those that the caller has not taken yet.
    pub(crate) blocks: Vec<u8>,
    /// Number of interfaces so far; packets are of the last one.
    interfaces: u32,
}

impl Writer {
    /// Starts a capture with one interface, this line.
    pub(crate) fn new(protocol: Protocol, port: &str, baud: u32) -> Self {
        let mut writer = Self::with_comment("");
        writer.interface(protocol, port, baud);
        writer
    }

    /// Starts a capture that has no interface yet, with a text for people.
    pub(crate) fn with_comment(comment: &str) -> Self {
        let mut writer = Self::default();
        writer.write(u32::from_le_bytes(MAGIC), |body| {
            body.extend(BYTE_ORDER.to_le_bytes());
            body.extend([1, 0, 0, 0]); // version 1.0
            body.extend((-1_i64).to_le_bytes()); // length of the section: unknown
            put_option(body, option::USER_APPLICATION, b"axle");
            if !comment.is_empty() {
                put_option(body, option::COMMENT, comment.as_bytes());
            }
            put_option(body, option::END, &[]);
        });
        writer
    }

    /// Continues with another line, as a new interface. A speed of 0 is not known.
    pub(crate) fn interface(&mut self, protocol: Protocol, port: &str, baud: u32) {
        self.write(block::INTERFACE, |body| {
            body.extend(link_type(protocol).to_le_bytes());
            body.extend([0; 2]);
            body.extend(0_u32.to_le_bytes()); // packets of any length
            put_option(body, option::INTERFACE_NAME, port.as_bytes());
            put_option(body, option::INTERFACE_DESCRIPTION, protocol.name().as_bytes());
            if baud > 0 {
                put_option(body, option::SPEED, &u64::from(baud).to_le_bytes());
            }
            put_option(body, option::TIME_UNIT, &[6]); // 10^-6 s
            put_option(body, option::END, &[]);
        });
        self.interfaces += 1;
    }

    /// Appends bytes that were complete at this time, microseconds since 1970.
    pub(crate) fn packet(&mut self, micros: u64, direction: Option<Direction>, bytes: &[u8]) {
        self.packet_of(self.interfaces.saturating_sub(1), micros, direction, bytes);
    }

    /// The same on the line with this number.
    pub(crate) fn packet_of(
        &mut self,
        interface: u32,
        micros: u64,
        direction: Option<Direction>,
        bytes: &[u8],
    ) {
        self.write(block::PACKET, |body| {
            body.extend(interface.to_le_bytes());
            body.extend(((micros >> 32) as u32).to_le_bytes());
            body.extend((micros as u32).to_le_bytes());
            let len = bytes.len() as u32;
            body.extend(len.to_le_bytes());
            body.extend(len.to_le_bytes());
            put_padded(body, bytes);
            if let Some(direction) = direction {
                put_option(body, option::FLAGS, &direction.flags().to_le_bytes());
                put_option(body, option::END, &[]);
            }
        });
    }

    fn write(&mut self, kind: u32, body: impl FnOnce(&mut Vec<u8>)) {
        let begin = self.blocks.len();
        self.blocks.extend(kind.to_le_bytes());
        self.blocks.extend([0; 4]);
        body(&mut self.blocks);
        let len = ((self.blocks.len() - begin) as u32 + 4).to_le_bytes();
        self.blocks.extend(len);
        if let Some(place) = self.blocks.get_mut(begin + 4..begin + 8) {
            place.copy_from_slice(&len);
        }
    }
}

/// The length of a packet with these bytes, and a direction.
pub(super) const fn packet_len(bytes: &[u8]) -> u64 {
    44 + bytes.len().next_multiple_of(4) as u64
}

/// Of blocks, the last of which may be cut off: the length of the whole ones, and how many of them
/// are packets.
pub(super) fn whole_blocks(blocks: &[u8]) -> (usize, u64) {
    let (mut rest, mut packets) = (blocks, 0);
    while let Some(([kind, len], _)) = rest.as_chunks::<4>().0.split_first_chunk::<2>() {
        let Some(next) = rest.get(u32::from_le_bytes(*len) as usize..) else { break };
        packets += u64::from(u32::from_le_bytes(*kind) == block::PACKET);
        rest = next;
    }
    (blocks.len() - rest.len(), packets)
}

fn put_option(body: &mut Vec<u8>, code: u16, value: &[u8]) {
    // A longer name than this does not exist; it would be cut.
    let value = value.get(..usize::from(u16::MAX)).unwrap_or(value);
    body.extend(code.to_le_bytes());
    body.extend((value.len() as u16).to_le_bytes());
    put_padded(body, value);
}

fn put_padded(body: &mut Vec<u8>, bytes: &[u8]) {
    body.extend(bytes);
    body.extend(core::iter::repeat_n(0, bytes.len().wrapping_neg() % 4));
}
