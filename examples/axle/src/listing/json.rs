//! One JSON object per line. The fields of a frame are those of the library.

use axlewire::ikeya::Mode;

use super::{Modes, Out, Place, REASONS, Shown, SkippedBytes, pending};
use axlewire::stream::Counters;

pub(super) fn frame(out: &mut Out, at: Place, frame: &impl Shown, modes: &Modes) {
    begin(out, "frame", at);
    let object = out.0.len();
    // Writing to memory does not fail, and the keys of a frame are strings.
    let _ = serde_json::to_writer(&mut out.0, frame);
    // Its fields follow those that are there.
    if let Some(brace) = out.0.get_mut(object) {
        *brace = b',';
    }
    if let Some(mode) = frame.commands().and_then(|node| modes.of(node)) {
        out.0.pop();
        out.text(match mode {
            Mode::Velocity => r#","mode":"velocity"}"#,
            Mode::Position => r#","mode":"position"}"#,
        });
    }
    out.text("\n");
}

pub(super) fn gap(out: &mut Out, at: Place, gap: &SkippedBytes) {
    begin(out, "skipped", at);
    out.text(r#","length":"#);
    out.number(gap.length);
    out.text(r#","reason":""#);
    out.text(gap.reason.name());
    out.text("\"");
    // A single reason needs no counts.
    if gap.account.skipped_for(gap.reason) < gap.length {
        out.text(r#","reasons":"#);
        reasons(out, &gap.account);
    }
    out.text("}\n");
}

/// Skipped bytes by reason.
pub(super) fn reasons(out: &mut Out, account: &Counters) {
    let mut before = "{\"";
    for reason in REASONS {
        let bytes = account.skipped_for(reason);
        if bytes > 0 {
            out.text(before);
            out.text(reason.name());
            out.text("\":");
            out.number(bytes);
            before = ",\"";
        }
    }
    out.text(if before == "{\"" { "{}" } else { "}" });
}

fn begin(out: &mut Out, event: &str, at: Place) {
    out.text(r#"{"event":""#);
    out.text(event);
    out.text(r#"","offset":"#);
    out.number(at.offset);
    if let Some(micros) = at.micros {
        out.text(r#","t":"#);
        seconds(out, micros);
    }
    if let Some(interface) = at.interface {
        out.text(r#","interface":"#);
        out.number(interface as u64);
    }
    if let Some(direction) = at.direction {
        out.text(r#","direction":""#);
        out.text(direction.name());
        out.text("\"");
    }
}

/// Microseconds as seconds.
pub(crate) fn seconds(out: &mut Out, micros: u64) {
    out.number(micros / 1_000_000);
    out.text(".");
    super::row::six_digits(out, micros % 1_000_000);
}

/// The last object of a listing.
pub(crate) fn summary(out: &mut Out, account: &Counters, times_back: u64) {
    out.text(r#"{"event":"summary""#);
    let counts = [
        ("received", account.received),
        ("framed", account.framed),
        ("skipped", account.skipped()),
        ("pending", pending(account)),
        ("frames", account.frames),
    ];
    for (name, count) in counts {
        out.text(",\"");
        out.text(name);
        out.text("\":");
        out.number(count);
    }
    out.text(r#","skipped_by":"#);
    reasons(out, account);
    if times_back > 0 {
        out.text(r#","times_back":"#);
        out.number(times_back);
    }
    out.text("}\n");
}
