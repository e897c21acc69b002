//! Starts of frames looked for in AVX2 lanes, 64 places at a time.

use super::{LEN_WITHOUT_BODY, SYNC};
use crate::{
    simd::{Avx2, with_avx2},
    stream::{Framing, Reason, Swept, Verdict},
};

/// Places that are judged together, a bit in a word for each.
const PLACES: usize = 64;

/// What the last of the places can see: the sync and the length field.
const BLOCK: usize = PLACES + 3;

/// Refuses bytes at the front until a frame may stand there, or few are left.
#[inline(always)]
pub(super) fn sweep<F: Framing, const CAP: usize>(bytes: &[u8]) -> Swept {
    if bytes.len() < BLOCK {
        return Swept::default();
    }
    with_avx2(
        #[inline(always)]
        |simd| sweep_in::<F, CAP>(simd, bytes),
    )
    .unwrap_or_default()
}

#[inline(always)]
fn sweep_in<F: Framing, const CAP: usize>(simd: Avx2, bytes: &[u8]) -> Swept {
    let mut swept = Swept::default();
    let mut rest = bytes;
    while let Some(block) = rest.first_chunk::<BLOCK>() {
        let syncs = simd.places([0, 32].map(|at| {
            let first = simd.is(simd.load(block, at), SYNC[0]);
            simd.and(first, simd.is(simd.load(block, at + 1), SYNC[1]))
        }));
        if syncs != 0 {
            let lengths = simd.places([0, 32].map(|at| {
                let low = simd.is_in(simd.load(block, at + 2), LEN_WITHOUT_BODY as u8, CAP as u8);
                simd.and(low, simd.is(simd.load(block, at + 3), 0))
            }));
            let mut candidates = syncs & lengths;
            while candidates != 0 {
                let place = candidates.trailing_zeros() as usize;
                let candidate = rest.get(place..).unwrap_or_default();
                if !matches!(F::judge(candidate), Verdict::Reject { reason: Reason::Crc, .. }) {
                    let before = syncs & !(u64::MAX << place);
                    swept.len += place;
                    swept.length += (before & !lengths).count_ones() as usize;
                    swept.crc += (before & lengths).count_ones() as usize;
                    return swept;
                }
                candidates &= candidates - 1;
            }
            swept.length += (syncs & !lengths).count_ones() as usize;
            swept.crc += (syncs & lengths).count_ones() as usize;
        }
        swept.len += PLACES;
        rest = rest.get(PLACES..).unwrap_or_default();
    }
    swept
}
