//! Bytes on their way to a receiver.

use alloc::collections::VecDeque;

use crate::time::Instant;

/// Received bytes in order, with their times of arrival, some in the future.
#[derive(Clone, Debug, Default)]
pub(super) struct Arrivals {
    pub(super) bytes: VecDeque<(Instant, u8)>,
    last: Option<Instant>,
}

impl Arrivals {
    pub(super) const fn new() -> Self {
        Self { bytes: VecDeque::new(), last: None }
    }

    /// Notes a byte that arrives at `at`, but not before the previous one.
    pub(super) fn add(&mut self, byte: u8, at: Instant) {
        let at = self.last.map_or(at, |last| last.max(at));
        self.last = Some(at);
        self.bytes.push_back((at, byte));
    }
}
