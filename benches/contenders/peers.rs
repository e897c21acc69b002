//! Other crates on frames of their own protocols, as long as ours: clean streams, so that every
//! parser does only its ordinary work.

use std::io::Cursor;

use axlewire::crc16;
use mavlink::{
    MavHeader, MavlinkReader, MavlinkVersion,
    dialects::common::{ATTITUDE_QUATERNION_DATA, MavMessage},
};
use modbus_core::rtu::{self, DecodedFrame};
use rmodbus::{ModbusProto, server::ModbusFrame};
use ublox::{Parser, UbxPacket, proto23::PacketRef};

use crate::{Tally, streams::Rng};

/// A crate with frames for it.
#[derive(Clone, Copy, Debug)]
pub struct Peer {
    /// Its name.
    pub name: &'static str,
    /// Length of each frame, bytes.
    pub frame_len: usize,
    /// Makes this many frames.
    pub frames: fn(usize) -> Vec<u8>,
    /// What the crate finds in them.
    pub read: fn(&[u8]) -> Tally,
    /// Where a frame has its id and its first four payload bytes as the crate gives them.
    sample: fn(&[u8]) -> (u8, [u8; 4]),
}

impl Peer {
    /// What is in these frames, known without the crate.
    #[must_use]
    pub fn contents(&self, frames: &[u8]) -> Tally {
        let mut tally = Tally::default();
        for frame in frames.chunks_exact(self.frame_len) {
            let (id, payload) = (self.sample)(frame);
            tally.add(id, Some(payload));
        }
        tally
    }
}

/// `mavlink` on attitudes: sequence number, and time since boot.
pub const MAVLINK: Peer = Peer {
    name: "mavlink",
    frame_len: MAVLINK_LEN,
    frames: mavlink_frames,
    read: mavlink_read,
    sample: |frame| (frame[4], four(&frame[10..])),
};

/// `ublox` on velocities: message id, and time of week.
pub const UBLOX: Peer = Peer {
    name: "ublox",
    frame_len: UBLOX_LEN,
    frames: ublox_frames,
    read: ublox_read,
    sample: |frame| (frame[3], four(&frame[6..])),
};

/// `modbus-core` on responses: address, and the rest from the function code on.
pub const MODBUS_CORE_RESPONSES: Peer = Peer {
    name: "modbus-core, responses",
    frame_len: MODBUS_RESPONSE_LEN,
    frames: modbus_responses,
    read: modbus_read_responses,
    sample: |frame| (frame[0], four(&frame[1..])),
};

/// The same on requests.
pub const MODBUS_CORE_REQUESTS: Peer = Peer {
    name: "modbus-core, requests",
    frame_len: MODBUS_REQUEST_LEN,
    frames: modbus_requests,
    read: modbus_read_requests,
    sample: |frame| (frame[0], four(&frame[1..])),
};

/// `rmodbus` on requests: address, and number of the register, big-endian in the frame.
pub const RMODBUS_REQUESTS: Peer = Peer {
    name: "rmodbus",
    frame_len: MODBUS_REQUEST_LEN,
    frames: modbus_requests,
    read: rmodbus_read_requests,
    sample: |frame| (frame[0], [frame[3], frame[2], 0, 0]),
};

/// The first four of these bytes.
fn four(bytes: &[u8]) -> [u8; 4] {
    bytes.first_chunk().copied().unwrap_or_default()
}

/// Length of a MAVLink frame here, bytes: that of a UCP report.
const MAVLINK_LEN: usize = 44;

/// Length of a UBX frame here, bytes: that of a UCP report.
const UBLOX_LEN: usize = 44;

/// Length of a Modbus response here, bytes: registers have two bytes each, so one less than a
/// report.
const MODBUS_RESPONSE_LEN: usize = 43;

/// Length of a Modbus request here, bytes: that of an Ikeya response.
const MODBUS_REQUEST_LEN: usize = 8;

/// MAVLink 2 frames with an attitude each.
fn mavlink_frames(count: usize) -> Vec<u8> {
    let mut rng = Rng::new(5);
    let mut bytes = Vec::with_capacity(count * MAVLINK_LEN);
    let mut unit = || rng.below(1 << 20) as f32 / (1 << 20) as f32 + 0.5;
    for sequence in 0..count {
        let header = MavHeader { system_id: 1, component_id: 1, sequence: sequence as u8 };
        let attitude = ATTITUDE_QUATERNION_DATA {
            time_boot_ms: sequence as u32,
            q1: unit(),
            q2: unit(),
            q3: unit(),
            q4: unit(),
            rollspeed: unit(),
            pitchspeed: unit(),
            yawspeed: unit(),
        };
        mavlink::write_v2_msg(&mut bytes, header, &MavMessage::ATTITUDE_QUATERNION(attitude))
            .expect("a vector accepts all bytes");
    }
    bytes
}

/// `mavlink`, reading from memory into its own message type.
fn mavlink_read(bytes: &[u8]) -> Tally {
    let mut tally = Tally::default();
    let mut reader = MavlinkReader::new(Cursor::new(bytes));
    // The end of the bytes gives an error.
    while let Ok((header, message)) = reader.read_message::<MavMessage>(MavlinkVersion::V2) {
        if let MavMessage::ATTITUDE_QUATERNION(attitude) = message {
            tally.add(header.sequence, Some(attitude.time_boot_ms.to_le_bytes()));
        }
    }
    tally
}

/// UBX frames with a velocity (NAV-VELNED) each.
fn ublox_frames(count: usize) -> Vec<u8> {
    let mut rng = Rng::new(7);
    let mut bytes = Vec::with_capacity(count * UBLOX_LEN);
    for _ in 0..count {
        let mut frame = [0; UBLOX_LEN];
        let (content, sums) = frame.split_at_mut(UBLOX_LEN - 2);
        content.fill_with(|| rng.byte());
        content[..6].copy_from_slice(&[0xB5, 0x62, 0x01, 0x12, 36, 0]);
        // Fletcher's two sums exclude the two header bytes.
        let (mut first, mut second) = (0u8, 0u8);
        for byte in &content[2..] {
            first = first.wrapping_add(*byte);
            second = second.wrapping_add(first);
        }
        sums.copy_from_slice(&[first, second]);
        bytes.extend(frame);
    }
    bytes
}

/// `ublox`, given everything at once, so that it borrows all frames and copies none.
fn ublox_read(bytes: &[u8]) -> Tally {
    let mut tally = Tally::default();
    let mut parser = Parser::default_proto();
    let mut packets = parser.consume_ubx(bytes);
    while let Some(packet) = packets.next() {
        if let Ok(UbxPacket::Proto23(PacketRef::NavVelNed(velocity))) = packet {
            tally.add(0x12, Some(velocity.itow().to_le_bytes()));
        }
    }
    tally
}

/// Modbus RTU responses with 19 registers each.
fn modbus_responses(count: usize) -> Vec<u8> {
    modbus_frames::<{ MODBUS_RESPONSE_LEN - 2 }>(count, [1, 3, 38])
}

/// Modbus RTU requests that write one register each.
fn modbus_requests(count: usize) -> Vec<u8> {
    modbus_frames::<{ MODBUS_REQUEST_LEN - 2 }>(count, [1, 6, 0])
}

/// Frames that begin with `header`, then random bytes, then the CRC that both protocols share.
fn modbus_frames<const LEN: usize>(count: usize, header: [u8; 3]) -> Vec<u8> {
    let mut rng = Rng::new(6);
    let mut bytes = Vec::with_capacity(count * (LEN + 2));
    for _ in 0..count {
        let mut frame: [u8; LEN] = std::array::from_fn(|_| rng.byte());
        frame[..3].copy_from_slice(&header);
        bytes.extend(frame);
        bytes.extend(crc16::compute(&frame).to_le_bytes());
    }
    bytes
}

/// `modbus-core` on responses, each borrowed and not unpacked.
fn modbus_read_responses(bytes: &[u8]) -> Tally {
    modbus_read(modbus_core::DecoderType::Response, bytes)
}

/// `modbus-core` on requests, each borrowed and not unpacked.
fn modbus_read_requests(bytes: &[u8]) -> Tally {
    modbus_read(modbus_core::DecoderType::Request, bytes)
}

fn modbus_read(kind: modbus_core::DecoderType, mut bytes: &[u8]) -> Tally {
    let mut tally = Tally::default();
    while let Ok(Some((DecodedFrame { slave, pdu }, place))) = rtu::decode(kind, bytes) {
        tally.add(slave, pdu.first_chunk().copied());
        bytes = &bytes[place.start + place.size..];
    }
    tally
}

/// `rmodbus` as the server addressed by the requests. It does not search for frames: it gets each
/// one as a separate slice.
fn rmodbus_read_requests(bytes: &[u8]) -> Tally {
    let mut tally = Tally::default();
    let mut response = Vec::new();
    for request in bytes.chunks_exact(MODBUS_REQUEST_LEN) {
        let mut frame = ModbusFrame::new(1, request, ModbusProto::Rtu, &mut response);
        if frame.parse().is_ok() && frame.processing_required {
            tally.add(frame.unit_id, Some(u32::from(frame.reg).to_le_bytes()));
        }
    }
    tally
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_peer_finds_all_its_frames_with_their_contents() {
        for peer in [MAVLINK, UBLOX, MODBUS_CORE_RESPONSES, MODBUS_CORE_REQUESTS, RMODBUS_REQUESTS]
        {
            let frames = (peer.frames)(1000);
            assert_eq!(frames.len(), 1000 * peer.frame_len, "{}", peer.name);
            let all = peer.contents(&frames);
            assert!(all.frames == 1000 && all.sum > 100_000, "{}: {all:?}", peer.name);
            assert_eq!((peer.read)(&frames), all, "{}", peer.name);
            // A damaged frame is none.
            let mut damaged = frames;
            damaged[peer.frame_len + 7] ^= 1;
            assert_ne!((peer.read)(&damaged), all, "{}", peer.name);
        }
    }
}
