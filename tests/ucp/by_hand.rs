//! Hand-made frames.

use axlewire::crc16;

/// A hand-made frame, with any id and any body.
pub(crate) fn frame(id: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF];
    frame.extend((body.len() as u16 + 4).to_le_bytes());
    frame.extend([id, 0]);
    frame.extend(body);
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}
