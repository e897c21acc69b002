//! The decoder of the roles: less code, because every byte goes through the buffer.

#[cfg(any(test, feature = "ikeya"))]
use super::event::Event;
use super::{
    decoder::{Decoder, Held},
    framing::Framing,
};

impl<F: Framing, const N: usize> Decoder<F, N> {
    /// Returns exactly the events of [`decode`](Self::decode), but does not read frames in place in
    /// the input.
    ///
    /// Slower for long inputs, but saves some 700 bytes of flash. For the roles, which get a few
    /// bytes at a time.
    #[cfg(any(test, feature = "ikeya"))]
    pub(crate) fn decode_buffered(&mut self, input: &mut &[u8]) -> Option<Event<F::Frame<'_>>> {
        let held = self.advance_buffered(input)?;
        self.held_event(held)
    }

    /// Finds and books the next event, like [`decode_buffered`](Self::decode_buffered). The result
    /// does not borrow from `self`.
    pub(crate) fn advance_buffered(&mut self, input: &mut &[u8]) -> Option<Held> {
        // Each iteration takes in bytes, or is the last.
        loop {
            if self.fill.is_early() {
                if input.is_empty() {
                    return None;
                }
                let is_first = self.fill == Self::EMPTY;
                self.hold(input, self.fill.missing());
                if is_first {
                    // Refuse bytes that start no frame right away.
                    self.wake_now();
                }
                if self.fill.is_early() {
                    return None;
                }
            }
            let held = self.judge_held(0);
            if held.is_some() || !self.fill.is_early() {
                return held;
            }
        }
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use alloc::{format, vec, vec::Vec};

    use proptest::prelude::*;

    use super::*;

    /// Compares everything observable of both ways, after each piece.
    fn same_events<F: Framing, const N: usize>(
        pieces: &[(Vec<u8>, bool)],
    ) -> Result<(), TestCaseError>
    where
        for<'a> F::Frame<'a>: core::fmt::Debug,
    {
        let (mut plain, mut buffered) = (Decoder::<F, N>::new(), Decoder::<F, N>::new());
        for (piece, is_quiet) in pieces {
            let (mut left, mut right) = (piece.as_slice(), piece.as_slice());
            loop {
                let expected = plain.decode(&mut left).map(|event| format!("{event:?}"));
                let found = buffered.decode_buffered(&mut right).map(|event| format!("{event:?}"));
                prop_assert_eq!(&found, &expected);
                if expected.is_none() {
                    break;
                }
            }
            prop_assert_eq!((left, right), (&[][..], &[][..]));
            prop_assert_eq!(plain.counters(), buffered.counters());
            prop_assert_eq!(plain.pending(), buffered.pending());
            if *is_quiet {
                plain.idle();
                buffered.idle();
            }
        }
        Ok(())
    }

    /// Whole frames, headers and random bytes, in pieces, some of them followed by silence.
    fn pieces() -> impl Strategy<Value = Vec<(Vec<u8>, bool)>> {
        let sealed = |frame: &[u8]| [frame, &crate::crc16::compute(frame).to_le_bytes()].concat();
        let frames = vec![
            sealed(&[0xAA, 0x01]),
            sealed(&[0xBB, 0x08, 0x00, 0x00, 0x80, 0x3F]),
            sealed(&[0xCC, 0x01, 0x00, 0x00, 0x80, 0x3F]),
            sealed(&[0xDD, 0x02, 0x10, 0x00, 0x00, 0x00]),
            sealed(&[0xCC, 0x09, 0xAA, 0x01, 0xBE, 0xD0]),
            vec![0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42, 0xFD],
            vec![0xFD, 0xFF, 0x05, 0x00, 0x01, 0x00, 0x00, 0xBE, 0x00],
        ];
        let starts = vec![0xAA, 0xBB, 0xCC, 0xDD, 0xFD, 0xFF, 0x01];
        let run = prop_oneof![
            prop::sample::select(frames),
            prop::sample::select(starts).prop_map(|byte| vec![byte]),
            prop::collection::vec(any::<u8>(), 0..20),
        ];
        let stream = prop::collection::vec(run, 0..12).prop_map(|runs| runs.concat());
        (stream, prop::collection::vec((1..40_usize, prop::bool::weighted(0.1)), 1..60)).prop_map(
            |(mut stream, cuts)| {
                let mut pieces: Vec<_> = cuts
                    .into_iter()
                    .map(|(len, is_quiet)| {
                        let rest = stream.split_off(len.min(stream.len()));
                        (core::mem::replace(&mut stream, rest), is_quiet)
                    })
                    .collect();
                pieces.push((stream, true));
                pieces.push((Vec::new(), true));
                pieces
            },
        )
    }

    #[cfg(feature = "ikeya")]
    proptest! {
        #[test]
        fn the_buffered_way_finds_the_same_events_on_a_bus(pieces in pieces()) {
            same_events::<crate::ikeya::ToSlave, 16>(&pieces)?;
            same_events::<crate::ikeya::ToMaster, 16>(&pieces)?;
            same_events::<crate::ikeya::BothDirections, 8>(&pieces)?;
        }
    }

    #[cfg(feature = "ucp")]
    proptest! {
        #[test]
        fn the_buffered_way_finds_the_same_events_on_a_rover_link(pieces in pieces()) {
            same_events::<crate::ucp::Ucp, { crate::ucp::MAX_LEN }>(&pieces)?;
        }
    }
}
