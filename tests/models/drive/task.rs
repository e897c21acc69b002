//! Runs the calls of a driver: blocking ones directly, async ones with a waker that counts. A task
//! is polled only after it was woken.

use std::{
    future::Future,
    panic::{AssertUnwindSafe, catch_unwind},
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Wake, Waker},
};

use super::*;

/// Most polls of one call without time passing in between.
const POLLS: u32 = 40;

#[derive(Default)]
struct Wakes(AtomicUsize);

impl Wake for Wakes {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// How an async call has ended.
pub(crate) enum End<T> {
    /// Completed with this result, after this many polls.
    Done(T, usize),
    /// Dropped while waiting.
    Dropped,
}

/// Runs a call to completion, or drops it after this many polls.
pub(crate) fn run<T>(
    line: &Shared,
    drop_after: Option<usize>,
    future: impl Future<Output = T>,
) -> Result<End<T>, String> {
    let mut future = pin!(future);
    let wakes = Arc::new(Wakes::default());
    let waker = Waker::from(wakes.clone());
    let (mut polls, mut in_a_row) = (0, 0);
    loop {
        let seen = wakes.0.load(Ordering::Relaxed);
        let polled = future.as_mut().poll(&mut Context::from_waker(&waker));
        (polls, in_a_row) = (polls + 1, in_a_row + 1);
        if let Poll::Ready(output) = polled {
            return Ok(End::Done(output, polls));
        }
        let mut line = line.line();
        let pin_may_be_on = line.is_sending || line.has_pin_failed();
        if line.pin_on_us.is_some() && !pin_may_be_on {
            return Err("the driver-enable pin is on while the driver waits".into());
        }
        if drop_after == Some(polls) {
            return Ok(End::Dropped);
        }
        if wakes.0.load(Ordering::Relaxed) > seen {
            broken_if!(in_a_row > POLLS, "the call spins");
            continue;
        }
        let next_us = line.sleepers.iter().map(|&(at_us, ..)| at_us).min();
        let Some(next_us) = next_us else { return Err("nothing will wake the task".into()) };
        in_a_row = 0;
        line.pass_until(next_us);
    }
}

/// A call that panics, or does not end, has broken an invariant.
pub(crate) fn guarded<T>(call: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        Err(text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default())
    })
}
