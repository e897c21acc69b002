//! Judges the front of some bytes: the rule of all framings of the bus.

use super::wire::{
    ReadRequest,
    header::{POSITION, READ, VELOCITY, WRITE},
};
use crate::{
    crc16,
    stream::{Reason, Verdict},
};

/// The rule of all six framings: the header gives the length, then the CRC and the id are checked.
///
/// `LONG` is the length of everything but a READ. An impossible id with a good CRC belongs to a
/// foreign packet, which is skipped as a whole (ruling I1); with a bad CRC it is noise like any
/// other.
#[inline(always)]
pub(super) fn judge<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(
    bytes: &[u8],
) -> Verdict {
    match bytes.first() {
        Some(&WRITE) if TO_SLAVE => judge_packet::<LONG>(bytes),
        Some(&(VELOCITY | POSITION)) if TO_MASTER => judge_packet::<LONG>(bytes),
        Some(&READ) if TO_SLAVE => judge_packet::<{ ReadRequest::LEN }>(bytes),
        Some(_) => {
            Verdict::Reject { reason: Reason::Header, more: noise::<TO_SLAVE, TO_MASTER>(bytes) }
        }
        None => Verdict::Partial { need: 1 },
    }
}

/// Number of bytes after the first that are not headers.
fn noise<const TO_SLAVE: bool, const TO_MASTER: bool>(bytes: &[u8]) -> usize {
    let is_header = |byte: &u8| match *byte {
        READ | WRITE => TO_SLAVE,
        VELOCITY | POSITION => TO_MASTER,
        _ => false,
    };
    bytes.iter().skip(1).take_while(|byte| !is_header(byte)).count()
}

/// Judges a packet of `LEN` bytes with a valid header.
#[inline(always)]
fn judge_packet<const LEN: usize>(bytes: &[u8]) -> Verdict {
    let Some(packet) = bytes.first_chunk::<LEN>() else {
        return Verdict::Partial { need: LEN };
    };
    if !crc16::check_packet(packet) {
        Verdict::Reject { reason: Reason::Crc, more: 0 }
    } else if !matches!(packet.get(1), Some(1..=8)) {
        Verdict::Reject { reason: Reason::Id, more: LEN - 1 }
    } else {
        Verdict::Frame { len: LEN }
    }
}
