//! The page: one file with the values as JSON, and a script that draws them.

use serde::Serialize;

use super::picture::{Look, PALETTE, Panel, Picture, Series, Size};
use crate::failure::Failure;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// What the script draws.
#[derive(Serialize)]
struct Data<'a> {
    title: &'a str,
    axis: &'a str,
    unit: &'a str,
    end: f64,
    notes: &'a [String],
    palette: Vec<String>,
    panels: Vec<PanelData<'a>>,
}

#[derive(Serialize)]
struct PanelData<'a> {
    title: &'a str,
    unit: &'a str,
    size: &'static str,
    hint: &'a str,
    least: Option<(f64, f64)>,
    series: Vec<SeriesData<'a>>,
}

#[derive(Serialize)]
struct SeriesData<'a> {
    name: &'a str,
    look: &'static str,
    colour: usize,
    named: bool,
    /// Number of values, those that are not drawn too.
    count: u64,
    /// Whether a held value holds until the end.
    open: bool,
    /// Places in units of the axis.
    x: Vec<f64>,
    /// Values; of a tick, how many it stands for. Nothing where the curve is interrupted; a held
    /// value ends there.
    y: Vec<Option<f64>>,
}

/// The page of a picture.
pub(super) fn page(picture: &Picture) -> Result<String, Failure> {
    let data = Data {
        title: &picture.title,
        axis: &picture.axis.title,
        unit: picture.axis.unit,
        end: picture.axis.of(picture.axis.end),
        notes: &picture.notes,
        palette: PALETTE.iter().map(|(r, g, b)| format!("#{r:02x}{g:02x}{b:02x}")).collect(),
        panels: picture.panels.iter().map(|panel| panel_data(panel, picture)).collect(),
    };
    let data = serde_json::to_string(&data);
    let data = data.map_err(|error| Failure::Failed(format!("cannot make the page: {error}")))?;
    // Nothing in the data ends the script that it is in.
    let data = data.replace('<', "\\u003c");
    let title = picture.title.replace('&', "&amp;").replace('<', "&lt;");
    // What is put in is not searched again: a file may have the name of a place.
    let mut page = String::with_capacity(PAGE.len() + STYLE.len() + SCRIPT.len() + data.len());
    for part in PAGE.split_inclusive("}}") {
        let Some((text, place)) = part.split_once("{{") else {
            page.push_str(part);
            continue;
        };
        page.push_str(text);
        page.push_str(match place {
            "title}}" => &title,
            "style}}" => STYLE,
            "script}}" => SCRIPT,
            "data}}" => &data,
            _ => "",
        });
    }
    Ok(page)
}

fn panel_data<'a>(panel: &'a Panel, picture: &Picture) -> PanelData<'a> {
    PanelData {
        title: panel.title,
        unit: panel.unit,
        size: match panel.size {
            Size::Tall => "tall",
            Size::Low => "low",
            Size::Half => "half",
            Size::Rows => "rows",
        },
        hint: panel.hint,
        least: panel.least,
        series: panel.series.iter().map(|series| series_data(series, picture)).collect(),
    }
}

fn series_data<'a>(series: &'a Series, picture: &Picture) -> SeriesData<'a> {
    let Series { name, look, colour, is_named, columns } = series;
    let (mut x, mut y) = (vec![], vec![]);
    if *look == Look::Ticks {
        for (place, count) in columns.counts() {
            x.push(picture.axis.of(place));
            y.push(Some(count as f64));
        }
    } else {
        let mut pieces = columns.pieces_and_ends().peekable();
        while let Some((piece, end)) = pieces.next() {
            for point in piece {
                x.push(picture.axis.of(point.x));
                y.push(Some(point.y));
            }
            let end = end.map(|end| picture.axis.of(end));
            let end = end.or_else(|| pieces.peek().and(x.last().copied()));
            if let Some(end) = end {
                x.push(end);
                y.push(None);
            }
        }
    }
    let (look, count, open) = (look.name(), columns.count(), !columns.is_ended());
    SeriesData { name, look, colour: *colour, named: *is_named, count, open, x, y }
}
