//! Events of a role that the application has not taken yet: a queue, or a slot for the latest.

use heapless::Deque;

#[cfg(feature = "ikeya")]
use crate::stats::count;
use crate::stats::count_apart;

/// A queue of at most `N` events, in order.
///
/// Half of it is reserved for events that happen once (ruling U15): frequent events, and those that
/// repeat by themselves, never take that room. `LATEST` places are for as many kinds of which the
/// latest must not be lost, and for nothing else. Events that find no room are counted as lost,
/// unless the caller keeps them.
#[derive(Clone, Debug)]
pub(crate) struct Events<E, const N: usize, const LATEST: usize = 0> {
    queue: Deque<E, N>,
    lost: u32,
}

impl<E, const N: usize, const LATEST: usize> Events<E, N, LATEST> {
    pub(crate) const fn new() -> Self {
        Self { queue: Deque::new(), lost: 0 }
    }

    /// Queues a rare event, or returns it if there is no room.
    pub(crate) fn keep(&mut self, event: E) -> Result<(), E> {
        if LATEST > 0 && self.queue.len() + LATEST >= N {
            return Err(event);
        }
        self.queue.push_back(event)
    }

    /// Queues a rare event that cannot be kept elsewhere or repeated.
    pub(crate) fn push(&mut self, event: E) {
        if self.keep(event).is_err() {
            count_apart(&mut self.lost);
        }
    }

    /// Queues a frequent event, or one that repeats by itself.
    pub(crate) fn push_frequent(&mut self, event: E) {
        if self.is_reserved() {
            count_apart(&mut self.lost);
        } else {
            self.push(event);
        }
    }

    /// Queues an event of which only the latest of its kind matters. When room is short it replaces
    /// the newest event of that kind, so that the last one in the queue is always the latest. There
    /// is always room for one of each of `LATEST` kinds.
    #[cfg(feature = "ucp")]
    pub(crate) fn push_latest(&mut self, event: E, is_of_its_sort: impl Fn(&E) -> bool) {
        let is_reserved = self.is_reserved();
        let newest = self.queue.iter_mut().rev().find(|queued| is_of_its_sort(queued));
        match newest {
            Some(newest) if is_reserved => {
                *newest = event;
                count_apart(&mut self.lost);
            }
            _ if LATEST == 0 => self.push(event),
            _ => {
                // It has a place of its own.
                let _ = self.queue.push_back(event);
            }
        }
    }

    /// Changes queued events that are no longer true.
    #[cfg(feature = "ucp")]
    pub(crate) fn amend(&mut self, change: impl FnMut(&mut E)) {
        self.queue.iter_mut().for_each(change);
    }

    /// The newest queued event of a kind.
    #[cfg(feature = "ucp")]
    pub(crate) fn newest(&self, is_of_its_sort: impl Fn(&E) -> bool) -> Option<&E> {
        self.queue.iter().rev().find(|queued| is_of_its_sort(queued))
    }

    pub(crate) fn pop(&mut self) -> Option<E> {
        self.queue.pop_front()
    }

    /// Removes every event that does not stay; the others keep their order.
    pub(crate) fn retain(&mut self, mut stays: impl FnMut(&E) -> bool) {
        for _ in 0..self.queue.len() {
            match self.queue.pop_front() {
                Some(event) if stays(&event) => {
                    // There is room: it was just taken out.
                    let _ = self.queue.push_back(event);
                }
                _ => {}
            }
        }
    }

    /// Number of events that were refused or replaced; stops at 2^32 - 1.
    pub(crate) const fn lost(&self) -> u32 {
        self.lost
    }

    /// Whether the remaining room is for rare events only.
    fn is_reserved(&self) -> bool {
        self.queue.len() >= (N - LATEST) / 2
    }
}

/// A slot for one event, of which only the latest matters. A new event replaces one that was not
/// taken, which is counted as lost.
///
/// A queue of one would do the same, but needs 150 more bytes of flash.
#[cfg(feature = "ikeya")]
#[derive(Clone, Debug)]
pub(crate) struct Latest<E> {
    event: Option<E>,
    lost: u32,
}

#[cfg(feature = "ikeya")]
impl<E> Latest<E> {
    pub(crate) const fn new() -> Self {
        Self { event: None, lost: 0 }
    }

    pub(crate) fn put(&mut self, event: E) {
        if self.event.replace(event).is_some() {
            count(&mut self.lost);
        }
    }

    /// The event, without taking it.
    pub(crate) const fn peek(&self) -> Option<&E> {
        self.event.as_ref()
    }

    pub(crate) fn take(&mut self) -> Option<E> {
        self.event.take()
    }

    /// Number of events that were replaced; stops at 2^32 - 1.
    pub(crate) const fn lost(&self) -> u32 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequent_events_leave_half_of_the_room_to_rare_ones() {
        let mut events: Events<u8, 4> = Events::new();
        (0..4).for_each(|event| events.push_frequent(event));
        assert_eq!((events.keep(10), events.keep(11), events.keep(12)), (Ok(()), Ok(()), Err(12)));
        assert_eq!(events.lost(), 2, "the caller got the last one back");
        let all: heapless::Vec<u8, 8> = core::iter::from_fn(|| events.pop()).collect();
        assert_eq!(all, [0, 1, 10, 11]);
    }

    #[cfg(feature = "ucp")]
    #[test]
    fn there_is_always_room_for_the_latest_of_each_kind() {
        let mut events: Events<u8, 8, 2> = Events::new();
        for event in 0..6 {
            assert_eq!(events.keep(event), Ok(()));
        }
        assert_eq!(events.keep(6), Err(6));
        for event in [100, 110, 101, 111] {
            events.push_latest(event, |other| other / 10 == event / 10);
        }
        assert_eq!(events.lost(), 2, "the first of each kind");
        let all: heapless::Vec<u8, 8> = core::iter::from_fn(|| events.pop()).collect();
        assert_eq!(all, [0, 1, 2, 3, 4, 5, 101, 111]);
    }

    #[test]
    fn what_stays_keeps_its_order() {
        let mut events: Events<u8, 8> = Events::new();
        (0..8).for_each(|event| events.push(event));
        events.retain(|event| event % 3 != 0);
        let all: heapless::Vec<u8, 8> = core::iter::from_fn(|| events.pop()).collect();
        assert_eq!(all, [1, 2, 4, 5, 7]);
    }
}
