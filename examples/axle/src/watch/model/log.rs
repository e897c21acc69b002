//! The last gaps and events.

use std::collections::VecDeque;

use axlewire::ikeya::NodeId;

/// Number of entries that are kept.
const LEN: usize = 200;

/// Something that happened.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) struct Entry {
    /// When, microseconds since the start.
    pub(crate) at: u64,
    pub(crate) kind: Kind,
    /// The node that it is about, or near.
    pub(crate) node: Option<NodeId>,
    pub(crate) text: String,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Kind {
    /// Bytes that belong to no frame.
    Gap,
    Event,
}

/// The last entries.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log(VecDeque<Entry>);

impl Log {
    /// Adds an entry; the oldest gives way.
    pub(super) fn push(&mut self, entry: Entry) {
        if self.0.len() >= LEN {
            self.0.pop_front();
        }
        self.0.push_back(entry);
    }

    /// Adds an event of a node.
    pub(super) fn event(&mut self, at: u64, node: impl Into<Option<NodeId>>, text: String) {
        self.push(Entry { at, kind: Kind::Event, node: node.into(), text });
    }

    /// The entries, the newest first.
    pub(crate) fn newest(&self) -> impl Iterator<Item = &Entry> {
        self.0.iter().rev()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_keeps_the_newest_entries_in_constant_memory() {
        let mut log = Log::default();
        for at in 0..10_000 {
            log.event(at, NodeId::N1, at.to_string());
        }
        let newest: Vec<_> = log.newest().map(|entry| entry.at).collect();
        assert_eq!((newest.len(), newest[0], newest[LEN - 1]), (LEN, 9999, 10_000 - LEN as u64));
        assert!(log.0.capacity() < 4 * LEN);
    }
}
