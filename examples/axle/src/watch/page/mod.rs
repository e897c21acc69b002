//! The page as a picture: what is known of a line, in a buffer of any size. The most important
//! values have the first places, so a small terminal shows fewer of them.

mod bus;
mod log;
mod rover;
#[cfg(test)]
mod shots;
#[cfg(test)]
mod tests;
mod text;
mod view;

use ratatui_core::{
    buffer::Buffer,
    layout::Rect,
    style::{Modifier, Style},
};

use super::model::{Model, OfLine};
use crate::listing::REASONS;
use text::put;
use view::{ALARM, DOUBT, FAINT, PLAIN};
pub(crate) use view::{Filter, Role, View};

const TITLE: Style = Style::new().add_modifier(Modifier::REVERSED);
/// Draws the page.
pub(crate) fn draw(view: &View, model: &Model, buffer: &mut Buffer) {
    let area = *buffer.area();
    if area.is_empty() {
        return;
    }
    // From the top: title, totals, values, log; the keys are in the last row. A low page leaves out
    // the keys first, then the totals, then the title.
    let (has_keys, has_totals, has_title) = (area.height >= 4, area.height >= 6, area.height >= 3);
    let mut rest = area;
    if has_title {
        title(view, model, take_top(&mut rest, 1), buffer);
    }
    if has_totals {
        totals(view, model, take_top(&mut rest, 1), buffer);
    }
    if has_keys {
        let row = Rect { y: rest.bottom() - 1, height: 1, ..rest };
        rest.height -= 1;
        keys(view, row, buffer);
    }
    let used = match &model.line {
        OfLine::Bus(bus) => bus::draw(view, bus, model.now, rest, buffer),
        OfLine::Rover(rover) => rover::draw(view, rover, rest, buffer),
    };
    // An empty row in front of the log, if there is room for at least one entry.
    take_top(&mut rest, used + 1);
    if rest.height >= 2 {
        log::draw(view, model, rest, buffer);
    }
}

/// Cuts rows off the top.
fn take_top(rest: &mut Rect, rows: u16) -> Rect {
    let rows = rows.min(rest.height);
    let top = Rect { height: rows, ..*rest };
    rest.y += rows;
    rest.height -= rows;
    top
}

fn title(view: &View, model: &Model, row: Rect, buffer: &mut Buffer) {
    buffer.set_style(row, TITLE);
    let mut state = Vec::new();
    match view.role {
        Role::Watching => {}
        Role::Moving => state.push("MOVING".to_owned()),
        Role::Stopping => state.push("STOPPING".to_owned()),
    }
    if view.is_paused {
        state.push("PAUSED".to_owned());
    }
    if let Some(file) = &view.recording {
        state.push(format!("REC {file}"));
    }
    let mut state = state.join("  ");
    let seconds = model.now / 1_000_000;
    let clock = format!("{}:{:02}", seconds / 60, seconds % 60);
    if !state.is_empty() {
        state.push_str("  ");
    }
    state.push_str(&clock);
    let state = text::cut(&state, row.width);
    let width = state.chars().count() as u16;
    put(buffer, row, row.right() - width, row.y, &state, TITLE);
    let room = row.width.saturating_sub(width + 2);
    put(buffer, row, row.x, row.y, &text::cut(&view.title, room), TITLE);
}

fn totals(view: &View, model: &Model, row: Rect, buffer: &mut Buffer) {
    let counters = &model.counters;
    let load = 1000.0 * model.bytes.per_second / f64::from(view.baud.max(1));
    let skipped = counters.skipped();
    let mut long = format!(
        "{} frames, {:.0}/s  {} bytes, load {load:.0} %  {skipped} skipped",
        counters.frames, model.frames.per_second, counters.received,
    );
    let mut before = ": ";
    for reason in REASONS.into_iter().filter(|reason| counters.skipped_for(*reason) > 0) {
        long.push_str(&format!("{before}{} {reason}", counters.skipped_for(reason)));
        before = ", ";
    }
    let middle = format!("{:.0} frames/s  {skipped} skipped", model.frames.per_second);
    let short = format!("{:.0}/s  {skipped} bad", model.frames.per_second);
    let style = if skipped > 0 { DOUBT } else { PLAIN };
    put(buffer, row, row.x, row.y, &text::fitting(&[long, middle, short], row.width), style);
}

/// The keys, or their meaning.
fn keys(view: &View, row: Rect, buffer: &mut Buffer) {
    let filter = match view.filter {
        Filter::All => "all".to_owned(),
        Filter::Gaps => "gaps".to_owned(),
        Filter::Node(node) => format!("node {node}"),
    };
    let texts = match (view.role, view.has_help) {
        (Role::Stopping, _) => vec!["stopping ...".to_owned()],
        (Role::Moving, _) => vec![
            format!("space, s, q, Esc: STOP  p pause  f log: {filter}"),
            "space s q Esc: STOP".to_owned(),
            "q STOP".to_owned(),
        ],
        (Role::Watching, false) => vec![
            format!("q quit  p pause  f log: {filter}  r record  ? help"),
            "q quit p f r ?".to_owned(),
            "q quit".to_owned(),
        ],
        (Role::Watching, true) => vec![
            "latency: from a READ to its answer, as this machine heard both; a USB adapter adds up \
             to 16 ms  p: counting goes on"
                .to_owned(),
            "latency: READ to answer as heard here; a USB adapter adds up to 16 ms".to_owned(),
            "latency: as heard here".to_owned(),
            "? back".to_owned(),
        ],
    };
    let style = if view.role == Role::Watching { FAINT } else { ALARM };
    put(buffer, row, row.x, row.y, &text::fitting(&texts, row.width), style);
}
