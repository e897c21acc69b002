//! An executor in virtual time.

use std::{
    future::Future,
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Wake, Waker},
};

use super::{Port, World};

impl Port {
    /// Runs a future until it is ready, or drops it after this many polls. Like a real executor it
    /// polls only a task that was woken; a task that nobody will wake hangs.
    pub(in super::super) fn block_on<T>(
        &self,
        polls: Option<u8>,
        future: impl Future<Output = T>,
    ) -> Option<T> {
        let mut future = pin!(future);
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let (mut seen, mut count) = (usize::MAX, 0_u32);
        loop {
            let woken = wakes.0.load(Ordering::Relaxed);
            if woken == seen {
                if !self.world().wake_next() {
                    assert!(polls.is_some(), "a lost wake-up: nothing will ever happen");
                    return None;
                }
                continue;
            }
            if polls.is_some_and(|polls| count >= u32::from(polls)) {
                self.world().sleepers.clear();
                return None;
            }
            seen = woken;
            count += 1;
            assert!(count < 200_000, "endless polls");
            if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
                self.world().sleepers.clear();
                return Some(output);
            }
        }
    }
}

#[derive(Default)]
struct Wakes(AtomicUsize);

impl Wake for Wakes {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

impl World {
    /// Advances to the next sleeper and wakes it; `false` if there is none.
    fn wake_next(&mut self) -> bool {
        let Some(at) = self.sleepers.iter().map(|sleeper| sleeper.0).min() else { return false };
        self.now_us = self.now_us.max(at);
        let now_us = self.now_us;
        self.sleepers.retain(|(at, waker)| {
            let is_due = *at <= now_us;
            if is_due {
                waker.wake_by_ref();
            }
            !is_due
        });
        true
    }
}
