//! Batches: many bytes judged together, for speed on a host.
//!
//! A kernel must agree with [`Framing::judge`](super::Framing::judge) on the same bytes. A kernel
//! that judges nothing is correct, too, only slower.

/// How a framing judges many bytes at once. Used on a host only.
///
/// Private: framings of other crates use [`OneByOne`](super::OneByOne).
pub(crate) trait Kernel {
    /// Whether the batches may be compiled for AVX2 if feature `simd` is on.
    const USES_AVX2: bool = true;

    /// Rejects bytes at the front that are cheaper to reject together than one by one. `judge`
    /// would reject each of them, for the same reasons.
    ///
    /// Called after a rejected byte, where rejected bytes are dense. Anything may follow the batch,
    /// including more bytes to reject.
    #[inline(always)]
    fn reject_batch(_bytes: &[u8]) -> Rejected {
        Rejected::default()
    }

    /// Accepts adjacent frames at the front that are cheaper to judge together than one by one.
    /// More may follow.
    ///
    /// Each has the shortest or the longest length of its framing, and is either a frame according
    /// to `judge` or refused by `view`: [`Frames::each`](super::Frames::each) passes them on
    /// without judging them again, up to the first without a view. `is_wide` is true if registers
    /// have 256 bits.
    #[inline(always)]
    fn accept_batch(_bytes: &[u8], _is_wide: bool) -> Accepted {
        Accepted::default()
    }

    /// Whether the frame at the front of a batch has the shortest length, not the longest.
    #[inline(always)]
    fn is_short(_bytes: &[u8]) -> bool {
        false
    }
}

/// Bytes at the front that start no frame.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) struct Rejected {
    /// Number of bytes.
    pub(crate) len: usize,
    /// Number of those rejected for [`Reason::Length`](super::Reason::Length).
    pub(crate) length: usize,
    /// Number of those rejected for [`Reason::Crc`](super::Reason::Crc). The rest are for
    /// [`Reason::Header`](super::Reason::Header).
    pub(crate) crc: usize,
}

/// Adjacent frames at the front.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) struct Accepted {
    /// Number of frames.
    pub(crate) frames: usize,
    /// Total length, bytes.
    pub(crate) len: usize,
}

#[cfg(all(test, feature = "std"))]
pub(crate) mod tests {
    use alloc::vec;

    use super::*;
    use crate::stream::{Batch, Decoder, Frames, Framing, Reason, Verdict};

    /// Checks that batches agree with `judge`, with 256-bit registers and without.
    pub(crate) fn check_batches<F: Framing>(bytes: &[u8]) {
        check_rejected::<F>(bytes);
        check_accepted::<F>(bytes, false);
        check_accepted::<F>(bytes, true);
    }

    /// Checks that `judge` rejects each byte of a rejected batch, for the same reason.
    fn check_rejected<F: Framing>(bytes: &[u8]) {
        let rejected = F::Batch::reject_batch(bytes);
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
    fn check_accepted<F: Framing>(bytes: &[u8], is_wide: bool) {
        let batch = F::Batch::accept_batch(bytes, is_wide);
        let (mut frames, mut at) = (0, 0);
        while at < batch.len {
            let len = if F::Batch::is_short(&bytes[at..]) { F::MIN_LEN } else { F::MAX_LEN };
            let verdict = F::judge(&bytes[at..]);
            if F::view(&bytes[at..at + len]).is_none() {
                assert!(matches!(verdict, Verdict::Reject { .. }), "no view of a frame at {at}");
                return;
            }
            assert_eq!(verdict, Verdict::Frame { len }, "at {at}");
            (frames, at) = (frames + 1, at + len);
        }
        assert_eq!((frames, at), (batch.frames, batch.len));
    }

    /// A framing whose batches are wrong.
    struct Liar<const LIE: u8>;

    impl<const LIE: u8> Framing for Liar<LIE> {
        type Frame<'a> = &'a [u8];
        type Batch = Self;
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
    }

    impl<const LIE: u8> Batch for Liar<LIE> {}

    impl<const LIE: u8> Kernel for Liar<LIE> {
        fn accept_batch(bytes: &[u8], _is_wide: bool) -> Accepted {
            let (frames, len) = match LIE / 2 {
                0 => (usize::MAX, bytes.len()),
                1 => (10, bytes.len() + 1),
                2 => (10, 0),
                3 => (0, 10),
                4 => (1000, bytes.len() / 2 + 1),
                _ => (1000, usize::MAX),
            };
            Accepted { frames, len }
        }

        fn is_short(bytes: &[u8]) -> bool {
            bytes.len().is_multiple_of(3)
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
        feed::<8>();
        feed::<9>();
        feed::<10>();
        feed::<11>();
    }
}
