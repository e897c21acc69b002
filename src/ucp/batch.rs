//! Rejects many bytes at once: all places of a block are judged together, by sync and length only.
//!
//! The loop is a plain loop over arrays, which a compiler for a host vectorizes; other machines do
//! not call it.

use zerocopy::transmute;

use super::header::{LEN_WITHOUT_BODY, SYNC};
use crate::stream::Rejected;

/// Number of places judged together.
const PLACES: usize = 32;

/// Bytes that a block covers: the last place may begin a sync and a length field.
const BLOCK: usize = PLACES + 3;

/// Counts the bytes at the front that start no frame. Ends before a length that a frame may have,
/// or where less than a block is left.
#[inline(always)]
pub(super) fn reject_batch<const CAP: usize>(bytes: &[u8]) -> Rejected {
    let mut rejected = Rejected::default();
    while let Some(block) = bytes.get(rejected.len..).and_then(|rest| rest.first_chunk::<BLOCK>()) {
        let (mut syncs, mut starts) = ([0; PLACES], [0; PLACES]);
        let (mut count, mut any) = (0, 0);
        for at in 0..PLACES {
            let is_sync = (block[at] == SYNC[0]) & (block[at + 1] == SYNC[1]);
            let [least, most] = [LEN_WITHOUT_BODY as u8, CAP as u8];
            let low = block[at + 2];
            let has_length = (low >= least) & (low <= most) & (block[at + 3] == 0);
            syncs[at] = u8::from(is_sync);
            starts[at] = u8::from(is_sync & has_length);
            count += syncs[at];
            any |= starts[at];
        }
        if any == 0 {
            rejected.len += PLACES;
            rejected.length += usize::from(count);
            continue;
        }
        let first = first(starts);
        rejected.len += first;
        // The place at which the run ends has one of the syncs.
        if count > 1 {
            let in_front = syncs.into_iter().take(first);
            rejected.length += in_front.map(usize::from).sum::<usize>();
        }
        break;
    }
    rejected
}

/// Index of the first flag that is set; at the end if none is.
#[inline(always)]
fn first(flags: [u8; PLACES]) -> usize {
    let [low, high]: [u128; 2] = transmute!(flags);
    let zeros = match low {
        0 => 128 + u128::from_le(high).trailing_zeros(),
        _ => u128::from_le(low).trailing_zeros(),
    };
    zeros as usize / 8
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use alloc::vec::Vec;

    use proptest::{collection::vec, prelude::*, sample::select};

    use super::reject_batch;
    use crate::{
        stream::{Framing, check_batches},
        ucp::Ucp,
    };

    /// Dense syncs with all sorts of lengths, complete frames, and sparser stretches.
    fn stream() -> impl Strategy<Value = Vec<u8>> {
        let half = select([0xFD, 0xFF].as_slice());
        let byte = select([0xFD, 0xFF, 0xFD, 0xFF, 0, 1, 3, 4, 40, 60, 61, 252].as_slice());
        let ping = Just([0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42].to_vec());
        let piece = prop_oneof![
            3 => vec(half, 0..60),
            4 => vec(byte, 0..60),
            1 => vec(any::<u8>(), 0..60),
            2 => ping,
        ];
        vec(piece, 0..12).prop_map(|pieces| pieces.concat())
    }

    proptest! {
        #[test]
        fn a_batch_says_what_single_looks_say(stream in stream()) {
            for at in 0..stream.len().min(12) {
                check_batches::<Ucp>(&stream[at..]);
                check_batches::<Ucp<4>>(&stream[at..]);
                check_batches::<Ucp<252>>(&stream[at..]);
            }
        }
    }

    #[test]
    fn dense_syncs_are_rejected_up_to_their_last_places() {
        let dense = [0xFD, 0xFF].repeat(100);
        let rejected = Ucp::<60>::reject_batch(&dense);
        assert!((150..200).contains(&rejected.len), "{rejected:?}");
        assert_eq!(rejected, reject_batch::<60>(&dense));
        check_batches::<Ucp>(&dense);
    }
}
