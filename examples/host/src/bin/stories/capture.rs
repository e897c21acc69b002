//! The bytes on a simulated line as a pcapng file, cut into packets as `axle record` cuts them.
//!
//! The station at the head makes the recording, so what it sends has the direction `out`.

use axlewire::{
    sim::{Traced, Who},
    stream::{Framing, decode_capture},
    time::Duration,
};

/// What the file says about the line.
pub(crate) struct Described {
    /// One of the link types of `axle`: 147 for Ikeya MD, 150 for UCP.
    pub(crate) link_type: u16,
    pub(crate) protocol: &'static str,
    pub(crate) name: &'static str,
    pub(crate) baud: u32,
}

/// 1 January 2026, 8:00 UTC, in microseconds since 1970: when the line begins.
const BEGIN: u64 = 1_767_254_400_000_000;

/// Silence that ends a packet of bytes between frames: more than three bytes of the slower line.
const SILENCE: Duration = Duration::from_micros(300);

/// Flags of a packet: received or sent by the recording station.
const IN: u32 = 1;
const OUT: u32 = 2;

/// The file for what was traced on a line.
pub(crate) fn file<F: Framing>(described: &Described, trace: &[Traced]) -> Vec<u8> {
    let (sent, received): (Vec<_>, Vec<_>) = trace.iter().partition(|it| it.who == Who::Head);
    let mut packets = packets::<F>(&sent, OUT);
    packets.extend(self::packets::<F>(&received, IN));
    packets.sort_by_key(|packet| packet.micros);

    let mut file = Vec::new();
    begin(&mut file, described);
    for packet in &packets {
        packet.put(&mut file);
    }
    file
}

/// A frame, or bytes between two.
struct Packet {
    /// The time of its last byte, microseconds since 1970.
    micros: u64,
    flags: u32,
    bytes: Vec<u8>,
}

/// The bytes of one direction, cut.
fn packets<F: Framing>(trace: &[Traced], flags: u32) -> Vec<Packet> {
    let bytes: Vec<u8> = trace.iter().map(|it| it.byte).collect();
    let (events, _) = decode_capture::<F>(&bytes);
    let begins = events.iter().map(|(offset, _)| *offset);
    let ends = begins.clone().skip(1).chain([bytes.len()]);
    let runs = begins.zip(ends).filter_map(|(begin, end)| trace.get(begin..end));
    runs.flat_map(|run| run.chunk_by(|last, next| next.at - last.at < SILENCE))
        .filter_map(|run| {
            let micros = BEGIN + run.last()?.at.as_micros();
            Some(Packet { micros, flags, bytes: run.iter().map(|it| it.byte).collect() })
        })
        .collect()
}

/// The section and its only interface.
fn begin(file: &mut Vec<u8>, described: &Described) {
    block(file, 0x0A0D_0D0A, |body| {
        body.extend(0x1A2B_3C4D_u32.to_le_bytes()); // tells the byte order
        body.extend([1, 0, 0, 0]); // version 1.0
        body.extend((-1_i64).to_le_bytes()); // length of the section: unknown
        option(body, 4, b"axlewire stories"); // the program
        option(body, 0, &[]);
    });
    block(file, 1, |body| {
        body.extend(described.link_type.to_le_bytes());
        body.extend([0; 6]); // packets of any length
        option(body, 2, described.name.as_bytes());
        option(body, 3, described.protocol.as_bytes());
        option(body, 8, &u64::from(described.baud).to_le_bytes());
        option(body, 9, &[6]); // times are in 10^-6 s
        option(body, 0, &[]);
    });
}

impl Packet {
    fn put(&self, file: &mut Vec<u8>) {
        block(file, 6, |body| {
            let len = (self.bytes.len() as u32).to_le_bytes();
            body.extend([0; 4]); // the first interface
            body.extend(((self.micros >> 32) as u32).to_le_bytes());
            body.extend((self.micros as u32).to_le_bytes());
            body.extend([len, len].concat());
            padded(body, &self.bytes);
            option(body, 2, &self.flags.to_le_bytes());
            option(body, 0, &[]);
        });
    }
}

/// A block, with its length in front of the body and behind it.
fn block(file: &mut Vec<u8>, kind: u32, fill: impl FnOnce(&mut Vec<u8>)) {
    let mut body = Vec::new();
    fill(&mut body);
    let len = (body.len() as u32 + 12).to_le_bytes();
    file.extend(kind.to_le_bytes());
    file.extend(len);
    file.extend(body);
    file.extend(len);
}

fn option(body: &mut Vec<u8>, code: u16, value: &[u8]) {
    body.extend(code.to_le_bytes());
    body.extend((value.len() as u16).to_le_bytes());
    padded(body, value);
}

fn padded(body: &mut Vec<u8>, bytes: &[u8]) {
    body.extend(bytes);
    body.resize(body.len().next_multiple_of(4), 0);
}
