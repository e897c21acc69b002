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

/// Length of a MAVLink frame here, bytes: that of a UCP report.
pub const MAVLINK_LEN: usize = 44;

/// Length of a UBX frame here, bytes: that of a UCP report.
pub const UBLOX_LEN: usize = 44;

/// Length of a Modbus response here, bytes: registers have two bytes each, so one less than a
/// report.
pub const MODBUS_RESPONSE_LEN: usize = 43;

/// Length of a Modbus request here, bytes: that of an Ikeya response.
pub const MODBUS_REQUEST_LEN: usize = 8;

/// MAVLink 2 frames with an attitude each.
#[must_use]
pub fn mavlink_frames(count: usize) -> Vec<u8> {
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
#[must_use]
pub fn mavlink_read(bytes: &[u8]) -> Tally {
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
#[must_use]
pub fn ublox_frames(count: usize) -> Vec<u8> {
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
#[must_use]
pub fn ublox_read(bytes: &[u8]) -> Tally {
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
#[must_use]
pub fn modbus_responses(count: usize) -> Vec<u8> {
    modbus_frames::<{ MODBUS_RESPONSE_LEN - 2 }>(count, [1, 3, 38])
}

/// Modbus RTU requests that write one register each.
#[must_use]
pub fn modbus_requests(count: usize) -> Vec<u8> {
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
#[must_use]
pub fn modbus_read_responses(bytes: &[u8]) -> Tally {
    modbus_read(modbus_core::DecoderType::Response, bytes)
}

/// `modbus-core` on requests, each borrowed and not unpacked.
#[must_use]
pub fn modbus_read_requests(bytes: &[u8]) -> Tally {
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
#[must_use]
pub fn rmodbus_read_requests(bytes: &[u8]) -> Tally {
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
    fn the_frames_are_as_long_as_they_say() {
        assert_eq!(mavlink_frames(100).len(), 100 * MAVLINK_LEN);
        assert_eq!(ublox_frames(100).len(), 100 * UBLOX_LEN);
        assert_eq!(modbus_responses(100).len(), 100 * MODBUS_RESPONSE_LEN);
        assert_eq!(modbus_requests(100).len(), 100 * MODBUS_REQUEST_LEN);
    }

    #[test]
    fn every_peer_finds_all_its_frames() {
        assert_eq!(mavlink_read(&mavlink_frames(1000)).frames, 1000);
        assert_eq!(ublox_read(&ublox_frames(1000)).frames, 1000);
        assert_eq!(modbus_read_responses(&modbus_responses(1000)).frames, 1000);
        assert_eq!(modbus_read_requests(&modbus_requests(1000)).frames, 1000);
        assert_eq!(rmodbus_read_requests(&modbus_requests(1000)).frames, 1000);
    }
}
