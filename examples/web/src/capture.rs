//! A capture: decoded as a whole, then shown in parts.

use std::{
    collections::BTreeSet,
    io::{self, Read},
};

use axle::{
    columns,
    listen::summary,
    rows::{Column, Rows, Values},
};
use js_sys::{Float64Array, Function, Uint8Array};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::thrown;

/// The most bytes that are asked for at once.
const CHUNK: usize = 1 << 20;

/// A function of the page that gives the next bytes; none at the end.
struct Source(Function, Vec<u8>, usize);

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Self(next, held, from) = self;
        if *from == held.len() {
            let most = JsValue::from(CHUNK as u32);
            let given = next.call1(&JsValue::NULL, &most).map_err(|error| {
                let message = js_sys::Reflect::get(&error, &"message".into()).ok();
                let text = message.and_then(|it| it.as_string());
                io::Error::other(text.unwrap_or_else(|| "the file cannot be read".to_owned()))
            })?;
            (*held, *from) = (Uint8Array::new(&given).to_vec(), 0);
        }
        let rest = held.get(*from..).unwrap_or_default();
        let len = rest.len().min(buffer.len());
        buffer.iter_mut().zip(rest).for_each(|(to, byte)| *to = *byte);
        *from += len;
        Ok(len)
    }
}

/// A capture that was decoded.
#[wasm_bindgen]
pub struct Capture {
    rows: Rows,
    summary: columns::Summary,
    /// How many rows each table has.
    counts: Vec<usize>,
    /// The rows that are shown, if not all.
    shown: Option<Vec<u32>>,
}

/// Decodes a capture. `read` is called with the number of bytes that it may give at most. The
/// protocol of raw bytes is found out if it is not named.
#[wasm_bindgen]
pub fn decode(read: Function, protocol: Option<String>) -> Result<Capture, JsError> {
    let source = Box::new(Source(read, Vec::new(), 0));
    let capture = columns::Capture::of(source, protocol.as_deref()).map_err(thrown)?;
    let (rows, summary) = capture.keep(|| Ok(())).map_err(thrown)?;
    let mut counts = vec![0; rows.tables().len()];
    for table in (0..rows.len()).filter_map(|row| rows.table(row)) {
        if let Some(count) = counts.get_mut(table) {
            *count += 1;
        }
    }
    Ok(Capture { rows, summary, counts, shown: None })
}

#[wasm_bindgen]
impl Capture {
    /// Frames and gaps, in their order.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The last line of `axle decode --json`, and why the capture could not be read to its end.
    pub fn summary(&self) -> String {
        let columns::Summary { account, times_back, cut, notes } = &self.summary;
        let line = summary(account, *times_back);
        let line: serde_json::Value = serde_json::from_slice(&line).unwrap_or_default();
        let has_times = self.rows.has_times();
        json!({ "summary": line, "cut": cut, "notes": notes, "has_times": has_times }).to_string()
    }

    /// The tables with their columns.
    pub fn tables(&self) -> String {
        let column = |it: &Column| {
            let is_number = !matches!(it.values, Values::Name(_) | Values::Bytes(..));
            json!({ "name": it.name, "unit": it.unit, "meaning": it.meaning, "numeric": is_number })
        };
        let table = |(number, name): (usize, &String)| {
            let columns: Vec<_> = self.rows.columns(number).iter().map(column).collect();
            json!({ "table": name, "rows": self.counts.get(number), "columns": columns })
        };
        let all: Vec<_> = self.rows.tables().iter().enumerate().map(table).collect();
        json!(all).to_string()
    }

    /// Shows only the rows of these tables, of which the line has this text in any case; returns
    /// how many. Without tables, those of all.
    pub fn filter(&mut self, tables: Vec<String>, text: &str) -> usize {
        if tables.is_empty() && text.is_empty() {
            self.shown = None;
            return self.rows.len();
        }
        let names = self.rows.tables().iter();
        let wanted: Vec<_> = names.map(|name| tables.is_empty() || tables.contains(name)).collect();
        let is_of_them =
            |row: &usize| self.rows.table(*row).and_then(|table| wanted.get(table)) == Some(&true);
        let of_them = (0..self.rows.len()).filter(is_of_them);
        let shown = match text {
            "" => of_them.collect(),
            text => self.rows.with_text(of_them, text),
        };
        let shown: Vec<_> = shown.into_iter().map(|row| row as u32).collect();
        self.shown.insert(shown).len()
    }

    /// The lines of `axle decode --json` of some of the rows shown.
    pub fn lines(&self, from: usize, count: usize) -> String {
        let rows = (from..from.saturating_add(count)).map_while(|at| self.shown(at));
        String::from_utf8_lossy(&self.rows.lines(rows)).into_owned()
    }

    /// Offset and bytes of a row shown; of a gap, no bytes.
    pub fn bytes(&self, row: usize) -> String {
        let (offset, bytes) =
            self.shown(row).and_then(|row| self.rows.bytes(row)).unwrap_or_default();
        let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        json!({ "offset": offset, "hex": hex.join(" ") }).to_string()
    }

    /// Columns of a table for a plot: the times in seconds since 1970, or the offsets without
    /// times; then the values of each column, NaN where there is none: whole rows in the order of
    /// time. Of more than some `points` from `from` to `to`, those with the smallest and the
    /// largest values of each stretch and node.
    pub fn series(
        &self,
        table: &str,
        columns: Vec<String>,
        from: f64,
        to: f64,
        points: usize,
    ) -> Vec<Float64Array> {
        let Some(table) = self.rows.tables().iter().position(|it| it == table) else {
            return Vec::new();
        };
        let (x, scale) = if self.rows.has_times() { ("t", 1e-6) } else { ("offset", 1.0) };
        let mut all = vec![Vec::new(); columns.len() + 2];
        self.rows.each_piece(table, 0..usize::MAX, |piece, _| {
            let find = |name: &str| piece.iter().find(|it| it.name == name);
            let names = [x, "node"].into_iter().chain(columns.iter().map(|it| &**it));
            for (name, to) in names.zip(&mut all) {
                to.extend(find(name).map(Column::numbers).unwrap_or_default());
            }
        });
        let [times, nodes, values @ ..] = &mut *all else { return Vec::new() };
        times.iter_mut().for_each(|time| *time *= scale);
        let is_within = |time: f64| !(time.is_nan() || time < from || time > to);
        let kept = thinned(times, nodes, values, is_within, points.max(2));
        let pick = |column: &Vec<f64>| {
            let picked: Vec<_> =
                kept.iter().map(|at| column.get(*at).copied().unwrap_or(f64::NAN)).collect();
            Float64Array::from(&*picked)
        };
        let of_nodes = 1;
        all.iter().enumerate().filter(|(at, _)| *at != of_nodes).map(|(_, it)| pick(it)).collect()
    }

    /// Rows of a table as `axle export` writes them to CSV; the titles are in front of the first.
    pub fn csv(&self, table: &str, from: usize, count: usize) -> String {
        let Some(table) = self.rows.tables().iter().position(|it| it == table) else {
            return String::new();
        };
        let csv = self.rows.csv(table, from..from.saturating_add(count));
        String::from_utf8_lossy(&csv).into_owned()
    }

    fn shown(&self, at: usize) -> Option<usize> {
        match &self.shown {
            Some(shown) => shown.get(at).map(|row| *row as usize),
            None => (at < self.rows.len()).then_some(at),
        }
    }
}

/// Which rows to draw, in the order of time: of each stretch and node, those with the smallest and
/// the largest value of some column.
fn thinned(
    times: &[f64],
    nodes: &[f64],
    columns: &[Vec<f64>],
    is_within: impl Fn(f64) -> bool,
    points: usize,
) -> Vec<usize> {
    let value = |column: &[f64], at: usize| column.get(at).copied().unwrap_or(f64::NAN);
    let time = |at: usize| value(times, at);
    let mut within: Vec<_> = (0..times.len()).filter(|at| is_within(time(*at))).collect();
    within.sort_by(|one, other| time(*one).total_cmp(&time(*other)));
    if within.len() <= points {
        return within;
    }
    let node = |at: usize| value(nodes, at) as u8;
    let known: BTreeSet<_> = within.iter().map(|at| node(*at)).collect();
    let per_stretch = 2 * columns.len().max(1) * known.len().max(1);
    let mut kept = Vec::new();
    for stretch in within.chunks((within.len() * per_stretch).div_ceil(points)) {
        let mut of_it = BTreeSet::new();
        for (column, known) in columns.iter().flat_map(|it| known.iter().map(move |id| (it, *id))) {
            // By their places in the stretch, which are in the order of time.
            let its = || {
                let all = stretch.iter().copied().enumerate();
                all.filter(|(_, at)| node(*at) == known && !value(column, *at).is_nan())
            };
            let by_value = |one: &(usize, usize), other: &(usize, usize)| {
                value(column, one.1).total_cmp(&value(column, other.1))
            };
            of_it.extend(its().min_by(by_value).into_iter().chain(its().max_by(by_value)));
        }
        kept.extend(of_it.into_iter().map(|(_, at)| at));
    }
    kept
}

/// How many of these bytes belong to frames of each protocol, and how many frames: the most first.
#[wasm_bindgen]
pub fn guess(bytes: &[u8]) -> String {
    let shares = axle::listen::guess(bytes);
    let all: Vec<_> = shares
        .iter()
        .map(|(name, framed, frames)| json!({ "protocol": name, "framed": framed, "frames": frames }))
        .collect();
    json!(all).to_string()
}
