//! Captures with times, built block by block, without the tool's own writer.

use std::process::Output;

/// A file, little-endian, in microseconds.
pub(crate) struct PcapNg(pub(crate) Vec<u8>);

/// One packet: microseconds since 1970, flags (1 in, 2 out, 0 unknown), bytes.
pub(crate) type Packet<'a> = (u64, u32, &'a [u8]);

impl PcapNg {
    /// One interface of this link type, and its packets.
    pub(crate) fn new(link_type: u16, packets: &[Packet<'_>]) -> Self {
        let mut file = Self(Vec::new());
        let header = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat();
        file.block(0x0A0D_0D0A, &header);
        file.interface(link_type);
        for packet in packets {
            file.packet(0, *packet);
        }
        file
    }

    /// Adds an interface.
    pub(crate) fn interface(&mut self, link_type: u16) {
        self.named(link_type, "tty0");
    }

    /// Adds an interface with this name.
    pub(crate) fn named(&mut self, link_type: u16, name: &str) {
        let mut body = u32::from(link_type).to_le_bytes().to_vec();
        body.extend([0; 4]);
        body.extend([2, 0, name.len() as u8, 0]);
        body.extend(name.bytes());
        body.resize(body.len().next_multiple_of(4), 0);
        body.extend([0; 4]);
        self.block(1, &body);
    }

    pub(crate) fn packet(&mut self, interface: u32, (micros, flags, bytes): Packet<'_>) {
        let (high, low, len) = ((micros >> 32) as u32, micros as u32, bytes.len() as u32);
        let words = [interface, high, low, len, len];
        let mut body: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        body.extend(bytes);
        body.resize(body.len().next_multiple_of(4), 0);
        if flags != 0 {
            body.extend([2, 0, 4, 0]);
            body.extend(flags.to_le_bytes());
            body.extend([0; 4]);
        }
        self.block(6, &body);
    }

    pub(crate) fn block(&mut self, kind: u32, body: &[u8]) {
        let len = body.len() as u32 + 12;
        self.0.extend([kind.to_le_bytes(), len.to_le_bytes()].concat());
        self.0.extend(body);
        self.0.extend(len.to_le_bytes());
    }
}

/// Standard output, exit code and the error line of a run.
pub(crate) fn outcome(output: Output) -> (String, Option<i32>, String) {
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (text(output.stdout), output.status.code(), text(output.stderr))
}
