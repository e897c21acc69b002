//! The rows of a motor bus: one per node, with as many columns as there is room for.

use axlewire::ikeya::{Mode, NodeId};
use ratatui_core::{buffer::Buffer, layout::Rect, style::Style};

use super::{
    text::{cut, millis, put, sparkline, values},
    view::{ALARM, DOUBT, FAINT, GOOD, PLAIN, View},
};
use crate::watch::model::{Bus, Health, Node, PER_SECOND};

/// A column, in the order in which they are shown.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Column {
    Node,
    Mode,
    Health,
    Value,
    Commanded,
    Trend,
    Rate,
    Latency,
    Missing,
    Damaged,
}

/// The columns in the order in which they get room.
const BY_WEIGHT: [Column; 10] = [
    Column::Node,
    Column::Health,
    Column::Value,
    Column::Mode,
    Column::Missing,
    Column::Damaged,
    Column::Rate,
    Column::Latency,
    Column::Trend,
    Column::Commanded,
];

const SHOWN: [Column; 10] = [
    Column::Node,
    Column::Mode,
    Column::Health,
    Column::Value,
    Column::Commanded,
    Column::Trend,
    Column::Rate,
    Column::Latency,
    Column::Missing,
    Column::Damaged,
];

/// The widest trend.
const TREND_WIDTH: u16 = 60;

/// Narrower pages have short titles and states.
const NARROW: u16 = 40;

/// The columns that there is room for, with their widths.
struct Columns {
    columns: Vec<(Column, u16)>,
    is_narrow: bool,
}

impl Columns {
    fn of(bus: &Bus, width: u16) -> Self {
        let is_narrow = width < NARROW;
        let value = match (is_narrow, bus.is_of_three()) {
            (true, _) => 11,
            (false, false) => 15,
            (false, true) => 26,
        };
        let width_of = |column| match column {
            Column::Node if is_narrow => 1,
            Column::Node => 4,
            Column::Mode => 8,
            Column::Health if is_narrow => 6,
            Column::Health => 9,
            Column::Value | Column::Commanded => value,
            Column::Trend => 9,
            Column::Rate => 6,
            Column::Latency | Column::Missing | Column::Damaged => 7,
        };
        let (mut left, mut chosen) = (width + 1, Vec::new());
        for column in BY_WEIGHT {
            match left.checked_sub(width_of(column) + 1) {
                Some(rest) => {
                    left = rest;
                    chosen.push(column);
                }
                None => break,
            }
        }
        let columns = SHOWN.into_iter().filter(|column| chosen.contains(column)).map(|column| {
            let more = if column == Column::Trend { left.min(TREND_WIDTH - 9) } else { 0 };
            (column, width_of(column) + more)
        });
        Self { columns: columns.collect(), is_narrow }
    }
}

/// Draws the table; returns the number of its rows.
pub(super) fn draw(view: &View, bus: &Bus, now: u64, area: Rect, buffer: &mut Buffer) -> u16 {
    // An id that only a search has asked for is not a node.
    let is_known = |node: &Node| node.answers > 0 || node.health(now) != Health::Quiet;
    let nodes: Vec<_> = bus.nodes().filter(|(_, node)| is_known(node)).collect();
    if nodes.is_empty() {
        put(buffer, area, area.x, area.y, &cut("no node heard yet", area.width), FAINT);
        return 1.min(area.height);
    }
    let columns = Columns::of(bus, area.width);
    let mut y = area.y;
    // One more node is worth more than the titles.
    if usize::from(area.height) > nodes.len() {
        let mut x = area.x;
        for &(column, width) in &columns.columns {
            let (name, is_right) = title(column, columns.is_narrow);
            let name = match column {
                Column::Trend => format!("last {} s", width / PER_SECOND),
                _ => name.to_owned(),
            };
            cell(buffer, area, (x, y, width), &name, is_right, FAINT);
            x += width + 1;
        }
        y += 1;
    }
    for (id, node) in nodes {
        let mut x = area.x;
        for &(column, width) in &columns.columns {
            let (text, style) = contents(view, column, id, node, now, width, columns.is_narrow);
            cell(buffer, area, (x, y, width), &text, title(column, false).1, style);
            x += width + 1;
        }
        y += 1;
    }
    (y - area.y).min(area.height)
}

/// The title of a column, and whether it is right-aligned.
const fn title(column: Column, is_narrow: bool) -> (&'static str, bool) {
    match column {
        Column::Node if is_narrow => ("n", false),
        Column::Node => ("node", false),
        Column::Mode => ("mode", false),
        Column::Health => ("state", false),
        Column::Value => ("value", true),
        Column::Commanded => ("commanded", true),
        Column::Trend => ("trend", false),
        Column::Rate => ("per s", true),
        Column::Latency => ("latency", true),
        Column::Missing => ("missing", true),
        Column::Damaged => ("damaged", true),
    }
}

fn contents(
    view: &View,
    column: Column,
    id: NodeId,
    node: &Node,
    now: u64,
    width: u16,
    is_narrow: bool,
) -> (String, Style) {
    let (unit, digits) = match node.mode {
        Some(Mode::Position) => ("turns", 4),
        _ => ("rps", 2),
    };
    let nothing = (String::new(), PLAIN);
    let count = |count: u64| (count.to_string(), if count > 0 { DOUBT } else { FAINT });
    match column {
        Column::Node => (id.to_string(), PLAIN),
        Column::Mode => node.mode.map_or(nothing, |mode| (mode.to_string(), PLAIN)),
        Column::Health => state(node.health(now), is_narrow),
        Column::Value => node.values.map_or(nothing, |(shown, _)| {
            let style = if node.health(now) == Health::Fine { PLAIN } else { FAINT };
            (values(&shown, unit, digits, width), style)
        }),
        Column::Commanded => {
            node.commanded().map_or(nothing, |to| (values(&to, unit, digits, width), PLAIN))
        }
        Column::Trend => (sparkline(node.trend.last(width.into()), view.is_ascii), GOOD),
        Column::Rate => (format!("{:.0}", node.packets.per_second), PLAIN),
        Column::Latency => node.latency.map_or(nothing, |latency| (millis(latency), PLAIN)),
        Column::Missing => count(node.missing),
        Column::Damaged => count(node.damaged),
    }
}

fn state(health: Health, is_narrow: bool) -> (String, Style) {
    match health {
        Health::Fine => ("ok".to_owned(), GOOD),
        Health::Missing(count) if is_narrow => (format!("miss {count}"), DOUBT),
        Health::Missing(count) => (format!("missing {count}"), DOUBT),
        Health::Silent => ("silent".to_owned(), ALARM),
        Health::Quiet => ("quiet".to_owned(), FAINT),
        Health::Commanded if is_narrow => ("cmds".to_owned(), DOUBT),
        Health::Commanded => ("commanded".to_owned(), DOUBT),
    }
}

/// Writes a text into a cell of the table: place and width.
fn cell(
    buffer: &mut Buffer,
    area: Rect,
    (x, y, width): (u16, u16, u16),
    text: &str,
    is_right: bool,
    style: Style,
) {
    let text = cut(text, width);
    let room = width.saturating_sub(text.chars().count() as u16);
    put(buffer, area, if is_right { x + room } else { x }, y, &text, style);
}
