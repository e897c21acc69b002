//! How full a buffer is, and when to look into it.

use core::ops::RangeInclusive;

use crate::machine::Word;

/// Bits of half a word.
const HALF: u32 = Word::BITS / 2;
const LOWER: Word = (1 << HALF) - 1;
const SIGN: Word = 1 << (Word::BITS - 1);
const BOTH: Word = 1 | 1 << HALF;

/// How many bytes a buffer holds, `end`, and how many of them to wait for before looking at them, `wake`.
///
/// Both in one word: a byte more is one addition, and its sign says whether more are missing. The lower half
/// is `end`, the upper half `end - wake`, or anything above 0 where nothing is waited for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Fill(Word);

impl Fill {
    /// The longest buffer, bytes: with one more in the upper half there is still no sign.
    pub(super) const MAX: usize = (1 << (HALF - 1)) - 2;

    /// `end` bytes, to be looked at when there are `wake`. Neither may be above [`MAX`](Self::MAX).
    #[inline(always)]
    pub(super) const fn until(wake: usize, end: usize) -> Self {
        let (wake, end) = (wake as Word, end as Word);
        Self(end | end.wrapping_sub(wake) << HALF)
    }

    /// `end` bytes, to be looked at.
    #[inline(always)]
    pub(super) const fn now(end: usize) -> Self {
        Self(end as Word | 1 << HALF)
    }

    #[inline(always)]
    pub(super) const fn end(self) -> usize {
        (self.0 & LOWER) as usize
    }

    /// Is it too early to look?
    #[inline(always)]
    pub(super) const fn is_early(self) -> bool {
        self.0 & SIGN != 0
    }

    /// How many bytes are missing before a look.
    #[inline(always)]
    pub(super) const fn missing(self) -> usize {
        if self.is_early() { (LOWER + 1 - (self.0 >> HALF)) as usize } else { 0 }
    }

    /// Is there what was waited for and nothing else, and are these so many bytes?
    #[inline(always)]
    pub(super) fn is_just(self, lens: RangeInclusive<usize>) -> bool {
        (*lens.start() as Word..=*lens.end() as Word).contains(&self.0)
    }

    /// With so many bytes more, together at most [`MAX`](Self::MAX).
    #[inline(always)]
    pub(super) const fn plus(self, len: usize) -> Self {
        Self(self.0.wrapping_add(len as Word * BOTH))
    }
}

#[cfg(test)]
mod tests {
    use super::Fill;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_addition_counts_what_is_held_and_what_is_missing(
            lens in prop::collection::vec(0..4_000_usize, 0..8), nth in 0..8_usize, beside in 0..3_usize,
        ) {
            // Mostly what is waited for comes to be there exactly.
            let wake = lens.iter().take(nth).sum::<usize>() + beside / 2;
            let (mut fill, mut now, mut end) = (Fill::until(wake, 0), Fill::now(0), 0);
            for len in lens {
                (fill, now, end) = (fill.plus(len), now.plus(len), end + len);
                prop_assert_eq!((fill.end(), now.end()), (end, end));
                prop_assert_eq!((fill.missing(), now.missing()), (wake.saturating_sub(end), 0));
                prop_assert_eq!((fill.is_early(), now.is_early()), (end < wake, false));
                for (from, to) in [(0, Fill::MAX), (end, end), (end + 1, Fill::MAX), (0, end / 2)] {
                    let is_just = end == wake && (from..=to).contains(&end);
                    prop_assert_eq!(fill.is_just(from..=to), is_just);
                    prop_assert_eq!(Fill::until(wake, end).is_just(from..=to), is_just);
                    prop_assert!(!now.is_just(from..=to));
                }
            }
        }
    }

    #[test]
    fn the_longest_buffer_can_be_full() {
        let full = Fill::until(Fill::MAX, 0).plus(Fill::MAX);
        assert_eq!((full.end(), full.is_just(1..=Fill::MAX), full.missing()), (Fill::MAX, true, 0));
        let full = Fill::now(0).plus(Fill::MAX);
        assert_eq!((full.end(), full.is_early()), (Fill::MAX, false));
        let empty = Fill::until(Fill::MAX, 0);
        assert_eq!((empty.end(), empty.missing(), empty.is_early()), (0, Fill::MAX, true));
    }
}
