//! Finds the contents of a stream slowly and simply: tries every offset with the bitwise CRC of the
//! C reference. It shares no code with axlewire.

use crate::{Tally, reference::crc_bitwise};

/// The frames of both directions of an Ikeya bus.
#[must_use]
pub fn ikeya(bytes: &[u8]) -> Tally {
    search(bytes, |rest| {
        let len = match rest.first()? {
            0xAA => 4,
            0xBB | 0x55 | 0x56 => 8,
            _ => return None,
        };
        let frame = rest.get(..len).filter(|frame| crc_is_right(frame))?;
        // A complete packet with an invalid node id is skipped as a whole (ruling I1).
        let payload = if len == 8 { frame.get(2..6) } else { None };
        Some(Candidate { len, id: frame[1], payload, counts: (1..=8).contains(&frame[1]) })
    })
}

/// The UCP frames of at most 64 bytes (ruling U2).
#[must_use]
pub fn ucp(bytes: &[u8]) -> Tally {
    search(bytes, |rest| {
        let [0xFD, 0xFF, low, high, ..] = *rest else { return None };
        let len = usize::from(u16::from_le_bytes([low, high]));
        if !(4..=60).contains(&len) {
            return None;
        }
        let len = len + 4;
        let frame = rest.get(..len).filter(|frame| crc_is_right(frame))?;
        let payload = frame.get(6..len - 2).and_then(|body| body.get(..4));
        Some(Candidate { len, id: frame[4], payload, counts: true })
    })
}

/// A complete frame with a correct CRC.
struct Candidate<'a> {
    len: usize,
    id: u8,
    payload: Option<&'a [u8]>,
    counts: bool,
}

/// A failed candidate costs one byte, a good one its length (ruling B2).
fn search<'a>(bytes: &'a [u8], at_front: impl Fn(&'a [u8]) -> Option<Candidate<'a>>) -> Tally {
    let mut tally = Tally::default();
    let mut at = 0;
    while at < bytes.len() {
        let Some(candidate) = at_front(&bytes[at..]) else {
            at += 1;
            continue;
        };
        if candidate.counts {
            tally.add(candidate.id, candidate.payload.and_then(|bytes| bytes.try_into().ok()));
        }
        at += candidate.len;
    }
    tally
}

fn crc_is_right(frame: &[u8]) -> bool {
    let (covered, crc) = frame.split_at(frame.len() - 2);
    crc_bitwise(covered).to_le_bytes() == crc
}
