//! Finds UCP frames in a byte stream.

use super::{
    batch,
    frame::Frame,
    header::{LEN_WITHOUT_BODY, MAX_LEN, OUTSIDE_LEN, SYNC},
};
use crate::{
    crc16,
    machine::IS_HOST,
    stream::{self, Framing, Reason, Rejected, Verdict},
};

/// Decoder with the default cap and the smallest buffer for it.
pub type Decoder = stream::Decoder<Ucp, MAX_LEN>;

/// Finds UCP frames whose length field is 4..=`CAP` (ruling U2).
///
/// The default of 60, frames of at most 64 bytes, is the most that a shipped robot survives, and
/// far above the largest known message. A larger cap, at most 252, lets foreign frames through, but
/// false headers then hold good frames back for longer.
#[derive(Clone, Copy, Debug)]
pub enum Ucp<const CAP: usize = 60> {}

impl<const CAP: usize> Framing for Ucp<CAP> {
    type Frame<'a> = &'a Frame;

    const MIN_LEN: usize = LEN_WITHOUT_BODY + OUTSIDE_LEN;
    const MAX_LEN: usize = {
        assert!(CAP >= LEN_WITHOUT_BODY && CAP <= 252, "the cap is 4..=252");
        CAP + OUTSIDE_LEN
    };

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        let Some(start) = bytes.first_chunk() else { return judge_start::<CAP>(bytes) };
        let len = match len_of::<CAP>(*start) {
            Ok(len) => len,
            Err(reason) => {
                let more = if reason == Reason::Header { noise(bytes) } else { 0 };
                return Verdict::Reject { reason, more };
            }
        };
        match bytes.get(..len) {
            Some(frame) if crc16::check(frame) => Verdict::Frame { len },
            Some(_) => Verdict::Reject { reason: Reason::Crc, more: 0 },
            None => Verdict::Partial { need: len },
        }
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<&Frame> {
        Frame::view(frame)
    }

    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        batch::reject_batch::<CAP>(bytes)
    }
}

/// Judges fewer bytes than a sync and a length field.
#[inline(always)]
fn judge_start<const CAP: usize>(bytes: &[u8]) -> Verdict {
    match len_of::<CAP>(fill_up(bytes)) {
        Ok(_) => Verdict::Partial { need: bytes.len() + 1 },
        Err(reason) => Verdict::Reject { reason, more: 0 },
    }
}

/// The length of the complete frame, or what is wrong.
#[inline(always)]
fn len_of<const CAP: usize>([first, second, low, high]: [u8; 4]) -> Result<usize, Reason> {
    if [first, second] != SYNC {
        return Err(Reason::Header);
    }
    let len = usize::from(u16::from_le_bytes([low, high]));
    if (LEN_WITHOUT_BODY..=CAP).contains(&len) {
        Ok(len + OUTSIDE_LEN)
    } else {
        Err(Reason::Length)
    }
}

/// Fills missing bytes with a sync and the length of the shortest frame: the result is wrong
/// exactly if the bytes present are wrong.
#[cold]
fn fill_up(bytes: &[u8]) -> [u8; 4] {
    let mut start = [SYNC[0], SYNC[1], LEN_WITHOUT_BODY as u8, 0];
    start.iter_mut().zip(bytes).for_each(|(filled, byte)| *filled = *byte);
    start
}

/// Number of bytes after the first that start no sync.
#[inline(always)]
fn noise(bytes: &[u8]) -> usize {
    let behind = bytes.get(1..).unwrap_or_default();
    if !IS_HOST {
        return noise_by_bytes(behind);
    }
    // Where false headers are dense, the next FD is a few bytes away: a predicted branch is then
    // faster than arithmetic.
    let few = noise_by_bytes(behind.first_chunk::<3>().map_or(behind, |near| near));
    match behind.get(3..) {
        Some(far) if few == 3 => few + noise_by_words(far),
        _ => few,
    }
}

/// Number of bytes before the first FD.
#[inline(always)]
fn noise_by_bytes(bytes: &[u8]) -> usize {
    bytes.iter().take_while(|&&byte| byte != SYNC[0]).count()
}

/// Same as [`noise_by_bytes`], eight bytes at a time.
#[inline(never)]
fn noise_by_words(bytes: &[u8]) -> usize {
    let every = |byte| u64::from_ne_bytes([byte; 8]);
    let mut rest = bytes;
    while let Some((word, behind)) = rest.split_first_chunk() {
        // FD becomes zero, and the first zero has the first borrow: before it no high bit is set.
        let word = u64::from_le_bytes(*word) ^ every(SYNC[0]);
        let zeros = word.wrapping_sub(every(1)) & !word & every(0x80);
        if zeros != 0 {
            return bytes.len() - rest.len() + zeros.trailing_zeros() as usize / 8;
        }
        rest = behind;
    }
    bytes.len() - rest.len() + noise_by_bytes(rest)
}
