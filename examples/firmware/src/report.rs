//! What a line of text tells of a role.
//!
//! Without hardware: tests on a host include this file, and reach counts that stay 0 in QEMU.

use axlewire::ikeya::Master;

use crate::text_line::TextLine;

impl TextLine {
    /// Adds the counts of a master, and how many exchanges its program has seen.
    pub fn master(&mut self, master: &Master, exchanges: u32) -> &mut Self {
        let statistics = master.statistics();
        self.count("reads", statistics.reads)
            .count("writes", statistics.writes)
            .count("exchanges", exchanges)
            .count("lost_events", master.lost_events())
    }
}
