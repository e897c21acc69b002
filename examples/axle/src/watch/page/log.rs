//! The last gaps and events.

use ratatui_core::{buffer::Buffer, layout::Rect};

use super::{
    text::{cut, put},
    view::{DOUBT, FAINT, Filter, PLAIN, View},
};
use crate::watch::model::{Entry, Kind, Model};

/// Narrower pages have no times.
const NARROW: u16 = 40;

impl Filter {
    fn shows(self, entry: &Entry) -> bool {
        match self {
            Self::All => true,
            Self::Gaps => entry.kind == Kind::Gap,
            Self::Node(node) => entry.node == Some(node),
        }
    }
}

/// Draws a title and the newest entries that there is room for, the oldest of them first.
pub(super) fn draw(view: &View, model: &Model, area: Rect, buffer: &mut Buffer) {
    let shown = match view.filter {
        Filter::All => "gaps and events".to_owned(),
        Filter::Gaps => "gaps".to_owned(),
        Filter::Node(node) => format!("gaps and events of node {node}"),
    };
    put(buffer, area, area.x, area.y, &cut(&shown, area.width), FAINT);
    let room = usize::from(area.height - 1);
    let newest = model.log.newest().filter(|entry| view.filter.shows(entry)).take(room);
    let entries: Vec<_> = newest.collect();
    for (y, entry) in (area.y + 1..).zip(entries.iter().rev()) {
        let text = if area.width < NARROW {
            entry.text.clone()
        } else {
            format!("{:9.3} s  {}", entry.at as f64 / 1e6, entry.text)
        };
        let style = if entry.kind == Kind::Gap { DOUBT } else { PLAIN };
        put(buffer, area, area.x, y, &cut(&text, area.width), style);
    }
}
