//! Good frames that are found many at once and handed out one by one.

use super::{Framing, Front, GoodRun, Verdict, ledger::Ledger, search, search_through};
use crate::simd::in_avx2;

/// A run of frames known to be good, and when to look for the next one.
///
/// A run is booked as a whole before its frames are handed out; [`unclaimed`](Self::unclaimed) says what of
/// it still has to be. So a frame of it changes nothing here: turns of a loop would wait for each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// The run goes on while more bytes than this follow.
    end: usize,
    /// To look again when no more than this follow.
    next_look: usize,
    /// From a vain look to the next one, bytes.
    wait: usize,
}

/// Fewer frames than this are judged one by one: a run that ends at once costs a branch that the
/// processor did not foresee.
const WORTH: usize = 4;

/// A look pays where it shows so many frames: all that Ikeya's can, or nearly.
const MANY: usize = 28;

/// The longest wait, bytes: what is lost when good frames come at last.
const LONGEST_WAIT: usize = 1 << 14;

impl Run {
    pub(super) const fn new() -> Self {
        Self { end: usize::MAX, next_look: usize::MAX, wait: 1 }
    }

    /// Is a good frame known to be at the front of `rest`?
    #[inline(always)]
    pub(super) fn goes_on<F: Framing>(&self, rest: &[u8]) -> bool {
        F::HAS_RUNS && rest.len() > self.end
    }

    /// [`search`], which may begin a run.
    #[inline(always)]
    pub(super) fn search<'b, F: Framing>(
        &mut self,
        bytes: &'b [u8],
        ledger: &mut Ledger,
    ) -> (&'b [u8], Front) {
        if !F::HAS_RUNS {
            return search::<F>(bytes, ledger, Ledger::refuse);
        }
        if bytes.len() > self.next_look {
            match F::judge(bytes) {
                Verdict::Frame { len } => return (bytes, Front::Frame { len }),
                Verdict::Partial { need } => return (bytes, Front::Partial { need }),
                Verdict::Reject { .. } => {}
            }
        }
        self.look_or_search::<F>(bytes, ledger)
    }

    /// Cold, so that the loop around it keeps its registers; one call for both, because a second one in
    /// that loop was slower than judging the first byte of a gap twice.
    #[cold]
    #[inline(never)]
    fn look_or_search<'b, F: Framing>(
        &mut self,
        bytes: &'b [u8],
        ledger: &mut Ledger,
    ) -> (&'b [u8], Front) {
        let is_due = bytes.len() <= self.next_look;
        match if is_due { self.begin::<F>(bytes, ledger) } else { None } {
            Some(len) => (bytes, Front::Frame { len }),
            None => search_through::<F>(bytes, ledger, Ledger::refuse),
        }
    }

    /// Looks for a run; the length of its first frame, which is not booked yet.
    fn begin<F: Framing>(&mut self, rest: &[u8], ledger: &mut Ledger) -> Option<usize> {
        let GoodRun { frames, len, is_cut } = in_avx2(|| F::good_run(rest)).unwrap_or_default();
        // Where damage is dense, looks cost more than they save.
        self.wait =
            if frames < MANY { (4 * self.wait).min(LONGEST_WAIT) } else { (self.wait / 4).max(1) };
        let is_known = frames >= WORTH && len <= rest.len();
        let behind = if is_known { rest.len() - len } else { rest.len() };
        self.end = if is_known { behind } else { usize::MAX };
        self.next_look = behind - if frames < MANY || is_cut { self.wait.min(behind) } else { 0 };
        is_known.then(|| {
            let first = front_len::<F>(rest);
            ledger.frames(frames - 1, len.saturating_sub(first));
            first
        })
    }

    /// What is booked and not handed out.
    pub(super) fn unclaimed<F: Framing>(&self, mut rest: &[u8]) -> GoodRun {
        let mut unclaimed =
            GoodRun { len: rest.len().saturating_sub(self.end), ..GoodRun::default() };
        while rest.len() > self.end {
            unclaimed.frames += 1;
            rest = rest.get(front_len::<F>(rest)..).unwrap_or_default();
        }
        unclaimed
    }
}

fn front_len<F: Framing>(rest: &[u8]) -> usize {
    if F::is_short(rest) { F::MIN_LEN } else { F::MAX_LEN }
}
