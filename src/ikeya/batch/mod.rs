//! Packets and noise of the bus, judged many bytes at a time on a host.

mod accept;
mod reject;

pub(super) use accept::accept_batch;
pub(super) use reject::reject_batch;

#[cfg(all(test, feature = "std"))]
mod tests {
    use alloc::vec::Vec;

    use proptest::{collection::vec, prelude::*, sample::select};

    use crate::{
        crc16::{self, TRINOMIAL},
        ikeya::{BothDirections, ToMaster, ToSlave, three},
        stream::{Framing, check_batches},
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
            let rejected = F::reject_batch(bytes).len;
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
        assert!(ToMaster::accept_batch(&answer) >= 14);
        assert!(BothDirections::accept_batch(&answer) >= 14);
        assert_eq!(three::ToMaster::accept_batch(&answer), 0);
    }
}
