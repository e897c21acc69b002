//! The clock of the tool's lines, waits and deadlines. A line that a unit test plays makes it
//! virtual for the thread of the test: then time passes only while that thread waits.

use std::{
    thread,
    time::{Duration, Instant},
};

#[cfg(test)]
std::thread_local! {
    static VIRTUAL: std::cell::Cell<Option<Instant>> = const { std::cell::Cell::new(None) };
}

/// From here on, time is virtual in this thread.
#[cfg(test)]
pub(crate) fn play() {
    VIRTUAL.set(Some(now()));
}

pub(crate) fn now() -> Instant {
    #[cfg(test)]
    if let Some(now) = VIRTUAL.get() {
        return now;
    }
    Instant::now()
}

/// Time since then.
pub(crate) fn since(begin: Instant) -> Duration {
    now().saturating_duration_since(begin)
}

/// Waits.
pub(crate) fn sleep(time: Duration) {
    #[cfg(test)]
    if let Some(now) = VIRTUAL.get() {
        return VIRTUAL.set(Some(now + time));
    }
    thread::sleep(time);
}
