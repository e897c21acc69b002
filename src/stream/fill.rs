//! Fill level of a buffer, and when to look at its bytes.

use core::ops::RangeInclusive;

use crate::machine::Word;

/// Half the bits of a word.
const HALF: u32 = Word::BITS / 2;
const LOWER: Word = (1 << HALF) - 1;
const SIGN: Word = 1 << (Word::BITS - 1);
const BOTH: Word = 1 | 1 << HALF;

/// Number of bytes in a buffer, `end`, and the number to wait for before looking at them, `wake`.
///
/// Both are in one word: counting another byte is one addition, and the sign tells whether bytes
/// are missing. The lower half is `end`. The upper half is `end - wake`, or anything above 0 if
/// there is nothing to wait for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Fill(Word);

impl Fill {
    /// Longest buffer, bytes: with one more in the upper half, the sign is still clear.
    pub(super) const MAX: usize = (1 << (HALF - 1)) - 2;

    /// `end` bytes; look at them when there are `wake`. Neither may exceed [`MAX`](Self::MAX).
    #[inline(always)]
    pub(super) const fn until(wake: usize, end: usize) -> Self {
        let (wake, end) = (wake as Word, end as Word);
        Self(end | end.wrapping_sub(wake) << HALF)
    }

    /// `end` bytes; look at them now.
    #[inline(always)]
    pub(super) const fn now(end: usize) -> Self {
        Self(end as Word | 1 << HALF)
    }

    #[inline(always)]
    pub(super) const fn end(self) -> usize {
        (self.0 & LOWER) as usize
    }

    /// Whether it is too early to look.
    #[inline(always)]
    pub(super) const fn is_early(self) -> bool {
        self.0 & SIGN != 0
    }

    /// Number of bytes missing before the next look.
    #[inline(always)]
    pub(super) const fn missing(self) -> usize {
        if self.is_early() { (LOWER + 1 - (self.0 >> HALF)) as usize } else { 0 }
    }

    /// Whether exactly the awaited bytes are there, and their number is in `lens`.
    #[inline(always)]
    pub(super) fn is_just(self, lens: RangeInclusive<usize>) -> bool {
        (*lens.start() as Word..=*lens.end() as Word).contains(&self.0)
    }

    /// With `len` bytes more; at most [`MAX`](Self::MAX) together.
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
            // In most cases the awaited number is reached exactly.
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
                    prop_assert!(!Fill::now(end).is_just(from..=to));
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
        assert!(Fill::now(0).plus(Fill::MAX + 1).is_early(), "one more is too long");
        let empty = Fill::until(Fill::MAX, 0);
        assert_eq!((empty.end(), empty.missing(), empty.is_early()), (0, Fill::MAX, true));
    }
}
