//! Good frames that are found many at once.

use super::{Framing, GoodRun};

/// When to look for a run.
///
/// A run that ends costs a branch that the processor did not foresee, and a look in vain is work for
/// nothing: where damage is dense, or frames are not of the lengths that runs have, it is done ever more
/// seldom.
#[derive(Debug)]
pub(super) struct Looks {
    /// The next one is due when no more than this is left, bytes.
    due: usize,
    /// From a look that did not pay to the next one, bytes.
    wait: usize,
}

/// A look pays where it shows so many frames: all that Ikeya's can, or nearly.
const MANY: usize = 14;

/// Two packets.
const FIRST_WAIT: usize = 16;

/// What is lost when good frames come at last, bytes.
const LONGEST_WAIT: usize = 1 << 14;

impl Looks {
    pub(super) const fn new() -> Self {
        Self { due: usize::MAX, wait: 0 }
    }

    /// The run at the front of `rest`, if a look is due and shows one.
    #[inline(always)]
    pub(super) fn run<F: Framing>(&mut self, rest: &[u8]) -> Option<GoodRun> {
        if cfg!(not(target_pointer_width = "64")) || rest.len() > self.due {
            return None;
        }
        let run = good_run::<F>(rest);
        let is_there = run.frames > 0 && (1..=rest.len()).contains(&run.len);
        let behind = if is_there { rest.len() - run.len } else { rest.len() };
        self.wait = if is_there && run.frames >= MANY {
            self.wait / 4
        } else {
            (4 * self.wait).clamp(FIRST_WAIT, LONGEST_WAIT)
        };
        self.due = behind.saturating_sub(self.wait);
        is_there.then_some(run)
    }
}

/// With feature `simd` compiled for all that the processor can do.
#[inline(always)]
fn good_run<F: Framing>(bytes: &[u8]) -> GoodRun {
    #[cfg(feature = "simd")]
    if F::SIMD {
        if let Some(run) = crate::simd::in_avx2(|| F::good_run(bytes, true)) {
            return run;
        }
    }
    F::good_run(bytes, false)
}
