//! Which pings may still be answered.

use std::collections::VecDeque;

use axlewire::time::{Duration, Instant};

/// Longest round trip of a line: an adapter, or a network in between. What was measured before the
/// robot heard of a stop says nothing about it.
pub(super) const LONGEST_TRIP: Duration = Duration::from_millis(1500);

/// The number of pings sent, at moments up to the longest round trip ago, and at one before.
#[derive(Default)]
pub(super) struct Pings(VecDeque<(Instant, u32)>);

impl Pings {
    /// Notes that so many have been sent by now.
    pub(super) fn note(&mut self, now: Instant, pings: u32) {
        self.0.push_back((now, pings));
        while self.0.get(1).is_some_and(|(at, _)| now - *at >= LONGEST_TRIP) {
            self.0.pop_front();
        }
    }

    /// How many of those sent by now may still be answered, at most: those from before the longest
    /// round trip are answered or lost.
    pub(super) fn open(&self, now: Instant, pings: u32, pongs: u32) -> u32 {
        let is_old = |(at, _): &&(Instant, u32)| now - *at >= LONGEST_TRIP;
        let before = self.0.front().filter(is_old).map_or(0, |(_, pings)| *pings);
        pings.saturating_sub(pongs).min(pings.saturating_sub(before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(1000 * millis)
    }

    #[test]
    fn all_young_pings_without_a_pong_are_open() {
        let mut pings = Pings::default();
        assert_eq!(pings.open(at(0), 2, 0), 2);
        pings.note(at(0), 2);
        pings.note(at(1000), 3);
        assert_eq!(pings.open(at(1499), 4, 0), 4);
        assert_eq!(pings.open(at(1499), 4, 3), 1);
        assert_eq!(pings.open(at(1499), 4, 5), 0, "others have pinged");
    }

    #[test]
    fn a_ping_is_lost_after_the_longest_round_trip_and_is_not_waited_for() {
        let mut pings = Pings::default();
        for millis in (0..=5000).step_by(500) {
            pings.note(at(millis), (millis / 500 + 1) as u32);
            // One each half second, none of them answered: three are younger than 1.5 s.
            let sent = (millis / 500 + 1) as u32;
            assert_eq!(pings.open(at(millis), sent, 0), sent.min(3), "{millis} ms");
        }
        assert_eq!(pings.0.len(), 4);
        // Later, without a round in between.
        assert_eq!(pings.open(at(60_000), 11, 0), 3);
        assert_eq!(pings.open(at(60_000), 11, 9), 2);
    }
}
