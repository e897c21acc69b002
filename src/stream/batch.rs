//! Batches: many bytes judged together, for speed on a host.

/// Bytes at the front that start no frame; see [`Framing`](super::Framing).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Rejected {
    /// Number of bytes.
    pub(crate) len: usize,
    /// Number of those rejected for [`Reason::Length`](super::Reason::Length).
    pub(crate) length: usize,
    /// Number of those rejected for [`Reason::Crc`](super::Reason::Crc). The rest are for
    /// [`Reason::Header`](super::Reason::Header).
    pub(crate) crc: usize,
}

#[cfg(all(test, feature = "std"))]
pub(crate) mod tests {
    use alloc::vec;

    use super::*;
    use crate::stream::{Decoder, Frames, Framing, Reason, Verdict};

    /// Checks that batches agree with `judge`.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    pub(crate) fn check_batches<F: Framing>(bytes: &[u8]) {
        check_rejected::<F>(bytes);
        check_accepted::<F>(bytes);
    }

    /// Checks that `judge` rejects each byte of a rejected batch, for the same reason.
    fn check_rejected<F: Framing>(bytes: &[u8]) {
        let rejected = F::reject_batch(bytes);
        let mut told = Rejected { len: rejected.len, ..Rejected::default() };
        for at in 0..rejected.len {
            match F::judge(&bytes[at..]) {
                Verdict::Reject { reason: Reason::Crc, more: 0 } => told.crc += 1,
                Verdict::Reject { reason: Reason::Length, more: 0 } => told.length += 1,
                Verdict::Reject { reason: Reason::Header, .. } => {}
                verdict => panic!("{verdict:?} at {at} of {}", rejected.len),
            }
        }
        assert_eq!(rejected, told);
    }

    /// Checks that `judge` finds the frames of an accepted batch, up to the first without a view.
    fn check_accepted<F: Framing>(bytes: &[u8]) {
        for frame in bytes.chunks_exact(F::MAX_LEN).take(F::accept_batch(bytes)) {
            let verdict = F::judge(frame);
            if F::view(frame).is_none() {
                assert!(matches!(verdict, Verdict::Reject { .. }), "no view of a frame");
                return;
            }
            assert_eq!(verdict, Verdict::Frame { len: F::MAX_LEN });
        }
        assert!(F::accept_batch(bytes) * F::MAX_LEN <= bytes.len());
    }

    /// A framing whose batches are wrong.
    struct Liar<const LIE: u8>;

    impl<const LIE: u8> Framing for Liar<LIE> {
        type Frame<'a> = &'a [u8];
        const MIN_LEN: usize = 2;
        const MAX_LEN: usize = 4;

        fn judge(bytes: &[u8]) -> Verdict {
            match bytes.len() {
                0..4 => Verdict::Partial { need: 4 },
                _ if LIE.is_multiple_of(2) => Verdict::Reject { reason: Reason::Crc, more: 0 },
                _ => Verdict::Frame { len: 4 },
            }
        }

        fn view(frame: &[u8]) -> Option<&[u8]> {
            Some(frame)
        }

        fn accept_batch(bytes: &[u8]) -> usize {
            match LIE / 2 {
                0 => usize::MAX,
                1 => bytes.len(),
                2 => bytes.len() / 4 + 1,
                _ => 10,
            }
        }

        fn reject_batch(bytes: &[u8]) -> Rejected {
            match LIE / 2 {
                0 => Rejected { len: bytes.len() + 1, length: usize::MAX, crc: usize::MAX },
                1 => Rejected { len: 0, length: 1, crc: 1 },
                _ => Rejected { len: 3, length: 7, crc: 7 },
            }
        }
    }

    #[test]
    fn a_batch_that_lies_hangs_nothing() {
        fn feed<const LIE: u8>() {
            for len in 0..100 {
                let bytes = vec![LIE; len];
                let mut frames = Frames::<Liar<LIE>>::new(&bytes);
                let mut found = 0;
                frames.each(|_| {
                    found += 1;
                    assert!(found <= len / 2, "lie {LIE} never ends");
                });
                assert!(frames.next().is_none());
                let mut decoder = Decoder::<Liar<LIE>, 4>::new();
                let mut input = &bytes[..];
                let events = core::iter::from_fn(|| decoder.decode(&mut input).map(drop));
                assert!(events.take(2 * len + 1).count() <= 2 * len, "lie {LIE} never ends");
            }
        }
        feed::<0>();
        feed::<1>();
        feed::<2>();
        feed::<3>();
        feed::<4>();
        feed::<5>();
        feed::<6>();
        feed::<7>();
    }
}
