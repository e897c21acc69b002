//! What was sent, how late, and what was not.

use axlewire::time::Duration;
use serde::Serialize;

use super::effect::Side;

/// The end of a replay, as an object or as a line.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Summary {
    /// Frames that were sent.
    pub(super) sent: usize,
    /// How much later than its time the latest of them was sent, microseconds: the time in the
    /// plan, or the end of the frame before it and its answer where the line is slower.
    pub(super) late_us: u32,
    /// Frames that did not leave whole, and those that are left.
    pub(super) lost: usize,
    pub(super) left: usize,
    /// READs of nodes that do not answer.
    pub(super) left_out: usize,
    /// Of the capture: frames of the other side, echoes, and bytes between frames.
    pub(crate) other_side: usize,
    pub(crate) echoes: usize,
    pub(crate) skipped_bytes: u64,
}

impl Summary {
    /// A frame has left, this much later than at its time.
    pub(super) fn count_sent(&mut self, late: Duration) {
        self.sent += 1;
        self.late_us = self.late_us.max(late.as_micros());
    }

    pub(super) fn line(&self, side: Side, is_json: bool) -> String {
        if is_json {
            let object = serde_json::to_string(self).unwrap_or_default();
            return format!("{{\"event\":\"summary\",{}", object.trim_start_matches('{'));
        }
        let mut line = format!("{} sent", counted(self.sent, "frame"));
        if self.sent > 0 {
            line += &format!(", at most {:.1} ms late", f64::from(self.late_us) / 1e3);
        }
        line + &self.rest(side)
    }

    /// The end of a dry run, which leaves all frames.
    pub(super) fn of_dry_run(mut self, side: Side) -> String {
        let frames = core::mem::take(&mut self.left);
        format!("{} would be sent{}", counted(frames, "frame"), self.rest(side))
    }

    /// What was not sent, and why.
    fn rest(&self, side: Side) -> String {
        let mut line = String::new();
        let other = match side {
            Side::Commander => "of the other side, which answers",
            Side::Device => "of the other side, which asks",
        };
        for (count, what, why) in [
            (self.lost, "frame", "did not leave whole"),
            (self.left, "frame", "not sent: the end came first"),
            (self.left_out, "READ", "left out: the node does not answer"),
            (self.other_side, "frame", other),
            (self.echoes, "frame", "an echo"),
            (self.skipped_bytes as usize, "byte", "between frames"),
        ] {
            if count > 0 {
                line += &format!("; {} {why}", counted(count, what));
            }
        }
        line
    }
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_sent_is_told_with_its_reason() {
        let mut summary = Summary { sent: 1, late_us: 1234, ..Summary::default() };
        assert_eq!(summary.line(Side::Commander, false), "1 frame sent, at most 1.2 ms late");
        (summary.lost, summary.left, summary.echoes, summary.skipped_bytes) = (1, 2, 3, 1);
        (summary.other_side, summary.left_out) = (4, 5);
        let says = "1 frame sent, at most 1.2 ms late; 1 frame did not leave whole; 2 frames not \
                    sent: the end came first; 5 READs left out: the node does not answer; 4 frames of the other side, which asks; 3 frames an \
                    echo; 1 byte between frames";
        assert_eq!(summary.line(Side::Device, false), says);
        let object = "{\"event\":\"summary\",\"sent\":1,\"late_us\":1234,\"lost\":1,\"left\":2,\
                      \"left_out\":5,\"other_side\":4,\"echoes\":3,\"skipped_bytes\":1}";
        assert_eq!(summary.line(Side::Device, true), object);
    }
}
