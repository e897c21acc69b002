//! Packets and noise of the bus, judged many bytes at a time on a host.

mod accept;
mod reject;

use super::wire::{VelocityResponse, header::READ};
use crate::stream::{Accepted, Batch, Kernel, Rejected};

/// The batches of one framing: `LONG` is the length of everything but a READ, the others are the
/// directions that it finds.
#[derive(Clone, Copy, Debug)]
pub enum PacketBatch<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> {}

impl<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> Batch
    for PacketBatch<LONG, TO_SLAVE, TO_MASTER>
{
}

impl<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> Kernel
    for PacketBatch<LONG, TO_SLAVE, TO_MASTER>
{
    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        reject::reject_batch::<LONG, TO_SLAVE, TO_MASTER>(bytes)
    }

    /// Nothing for a three-motor bus: its captures are small.
    #[inline(always)]
    fn accept_batch(bytes: &[u8], is_wide: bool) -> Accepted {
        if LONG == VelocityResponse::LEN {
            accept::accept_batch::<TO_SLAVE, TO_MASTER>(bytes, is_wide)
        } else {
            Accepted::default()
        }
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        bytes.first() == Some(&READ)
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use alloc::vec::Vec;

    use proptest::{collection::vec, prelude::*, sample::select};

    use crate::{
        crc16::{self, TRINOMIAL},
        ikeya::{BothDirections, ToMaster, ToSlave, three},
        stream::{Framing, Kernel, check_batches},
    };

    const HEADERS: [u8; 4] = [0xAA, 0xBB, 0x55, 0x56];

    fn check(bytes: &[u8]) {
        check_batches::<ToSlave>(bytes);
        check_batches::<ToMaster>(bytes);
        check_batches::<BothDirections>(bytes);
        check_batches::<three::ToSlave>(bytes);
        check_batches::<three::ToMaster>(bytes);
        check_batches::<three::BothDirections>(bytes);
    }

    /// Valid packets, and near misses: from an impossible node, with odd parity, or plainly
    /// damaged.
    fn packet() -> impl Strategy<Value = Vec<u8>> {
        let change = select([0, 0, 0, TRINOMIAL, 0x0100].as_slice());
        let len = select([4, 8, 8, 8, 16].as_slice());
        (select(HEADERS.as_slice()), 0..10_u8, len, any::<[u8; 12]>(), change).prop_map(
            |(header, id, len, payload, change)| {
                let len = if header == 0xAA { 4 } else { len };
                let body = [&[header, id][..], &payload].concat();
                let body = &body[..len - 2];
                [body, &(crc16::compute(body) ^ change).to_le_bytes()].concat()
            },
        )
    }

    /// Dense headers with packets in them, sparser stretches, and runs of packets.
    fn stream() -> impl Strategy<Value = Vec<u8>> {
        let header = select(HEADERS.as_slice());
        let byte = prop_oneof![3 => header.clone(), 1 => select([0, 1, 2, 9, 0xFC].as_slice())];
        let piece = prop_oneof![
            3 => vec(header, 0..60),
            3 => vec(byte, 0..60),
            1 => vec(any::<u8>(), 0..60),
            4 => packet(),
            3 => vec(packet(), 0..30).prop_map(|run| run.concat()),
        ];
        vec(piece, 0..12).prop_map(|pieces| pieces.concat())
    }

    proptest! {
        #[test]
        fn a_batch_says_what_single_looks_say(stream in stream()) {
            (0..stream.len().min(12)).for_each(|at| check(&stream[at..]));
        }
    }

    #[test]
    fn dense_headers_are_rejected_up_to_their_last_places() {
        fn check_end<F: Framing>(bytes: &[u8]) {
            let rejected = F::Batch::reject_batch(bytes).len;
            assert!((150..200).contains(&rejected), "{rejected}");
            check_batches::<F>(bytes);
        }
        let mut state = 1_u32;
        let dense: Vec<u8> = core::iter::repeat_with(|| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            HEADERS[(state >> 16) as usize % 4]
        })
        .take(200)
        .collect();
        check_end::<ToSlave>(&dense);
        check_end::<ToMaster>(&dense);
        check_end::<BothDirections>(&dense);
        check_end::<three::ToSlave>(&dense);
        check_end::<three::ToMaster>(&dense);
        check_end::<three::BothDirections>(&dense);
    }

    #[test]
    fn a_run_of_good_packets_is_accepted() {
        let answer = [0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E].repeat(20);
        let batch = <ToMaster as Framing>::Batch::accept_batch(&answer, false);
        assert!(batch.frames >= 14, "{batch:?}");
        assert_eq!(batch.len, 8 * batch.frames);
        let exchange = [0xAA, 0x01, 0xBE, 0xD0, 0xBB, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x43, 0x40];
        let batch = <ToSlave as Framing>::Batch::accept_batch(&exchange.repeat(20), true);
        assert!(batch.frames >= 14, "{batch:?}");
        // A READ of 4 bytes, and a WRITE of 8.
        assert_eq!(batch.len, batch.frames / 2 * 12 + batch.frames % 2 * 4);
        let answer = |header| {
            let body = [header, 0x02, 0, 0, 0, 0];
            [&body[..], &crc16::compute(&body).to_le_bytes()].concat()
        };
        let poll = [&exchange[..4], &answer(0x55), &exchange[..4], &answer(0x56)].concat();
        let batch = <BothDirections as Framing>::Batch::accept_batch(&poll.repeat(20), true);
        assert!(batch.frames >= 14, "{batch:?}");
        assert_eq!(batch.len, batch.frames / 2 * 12 + batch.frames % 2 * 4);
    }
}
