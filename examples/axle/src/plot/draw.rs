//! Draws a picture with plotters: panels above each other, each with its axes, legend and curves.

use core::{convert::Infallible, ops::Range};

use plotters::{
    coord::{Shift, ranged1d::Ranged, types::RangedCoordf64},
    prelude::{
        Cartesian2d, ChartBuilder, ChartContext, Circle, Color, DrawingArea, FontStyle,
        IntoDrawingArea, IntoFont, PathElement, RGBAColor, RGBColor, TRANSPARENT, TextStyle,
    },
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{
    canvas::{Canvas, FINE, Pen},
    labels::Labels,
    letters::Letters,
    picture::{Axis, Look, PALETTE, Panel, Picture, Series, Size},
    png::Png,
    svg::Svg,
};
use crate::failure::Failure;

type Area<'a, P> = DrawingArea<Canvas<'a, P>, Shift>;
type Chart<'b, 'a, P> =
    ChartContext<'b, Canvas<'a, P>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Problem = plotters::drawing::DrawingAreaErrorKind<Infallible>;

/// Width of a picture, pixels.
const WIDTH: u32 = 960;
/// Heights, pixels.
const TITLE: i32 = 40;
const NOTE: i32 = 15;
const HEADER: i32 = 24;
const LABELS: i32 = 18;
const ROW: i32 = 17;
const BETWEEN: i32 = 8;
/// At the left and the right edge.
const EDGE: i32 = 14;
/// For the labels of an axis, at least.
const LEFT: i32 = 48;
/// Between such a label and the axis.
const GAP: i32 = 8;
/// For how many ticks a row has.
const RIGHT: i32 = 34;

const INK: RGBColor = RGBColor(0x22, 0x26, 0x2B);
const SOFT: RGBColor = RGBColor(0x6A, 0x72, 0x7C);
const GRID: RGBColor = RGBColor(0xE6, 0xE9, 0xED);
const FRAME: RGBColor = RGBColor(0xC4, 0xCA, 0xD1);

/// Height of the letters.
const SMALL: f64 = 10.0;
const NORMAL: f64 = 11.0;
const LARGE: f64 = 14.0;

/// A curve may be that far from its values, pixels: less than is seen.
const TOLERANCE: f64 = 0.3;

/// Draws as SVG.
pub(super) fn to_svg(picture: &Picture) -> Result<String, Failure> {
    let letters = Letters::new()?;
    let layout = Layout::of(picture, &letters);
    let mut svg = Svg::new(layout.size(), &picture.title);
    layout.draw(picture, &letters, &mut svg)?;
    Ok(svg.finish())
}

/// Draws as PNG.
pub(super) fn to_png(picture: &Picture) -> Result<Vec<u8>, Failure> {
    let letters = Letters::new()?;
    let layout = Layout::of(picture, &letters);
    let mut png = Png::new(layout.size())?;
    layout.draw(picture, &letters, &mut png)?;
    png.finish()
}

/// Where the panels are.
struct Layout {
    /// For each panel: left, top, width, height, and whether its axis has labels.
    places: Vec<(i32, i32, i32, i32, bool)>,
    height: i32,
    /// Room for the labels of full-width panels, and of the others.
    left: i32,
    left_of_half: i32,
    /// At the right of a panel of half the width, for the last label below it.
    right_of_half: i32,
}

impl Layout {
    fn of(picture: &Picture, letters: &Letters) -> Self {
        let full = WIDTH as i32 - 2 * EDGE;
        let has_rows = picture.panels.iter().any(|panel| panel.size == Size::Rows);
        let widest = |ticks: &[f64]| {
            let labels = Labels::of(ticks);
            let width = |tick: &f64| letters.width(&labels.text(*tick), SMALL as f32, false);
            ticks.iter().map(width).fold(0.0, f32::max).ceil() as i32
        };
        // Panels above each other begin at the same place.
        let left_of = |is_half: bool| {
            let panels = picture.panels.iter();
            let panels = panels.filter(|panel| (panel.size == Size::Half) == is_half);
            panels.map(|panel| widest(&panel.ticks()) + GAP).fold(LEFT, i32::max)
        };
        let left = left_of(false).max(if has_rows { 2 * LEFT } else { LEFT });
        let below = widest(&ticks(0.0..picture.axis.span(), LABELS_OF_HALF));
        let mut layout = Self {
            places: vec![],
            height: TITLE,
            left,
            left_of_half: left_of(true),
            right_of_half: (below / 2 - EDGE).max(0),
        };
        let mut rest = &*picture.panels;
        while let Some((panel, others)) = rest.split_first() {
            let pair = others.first().filter(|_| panel.size == Size::Half);
            let is_pair = pair.is_some_and(|other| other.size == Size::Half);
            rest = if is_pair { others.get(1..).unwrap_or_default() } else { others };
            // Where panels of another width follow, the axis is another one.
            let is_last = rest
                .first()
                .is_none_or(|next| (next.size == Size::Half) != (panel.size == Size::Half));
            let labels = if is_last { LABELS } else { 0 };
            let plot = panel.height();
            let (top, height) = (layout.height, HEADER + plot + labels);
            let half = (full - 2 * EDGE) / 2;
            if is_pair {
                layout.places.push((EDGE, top, half, height, is_last));
                layout.places.push((EDGE + half + 2 * EDGE, top, half, height, is_last));
            } else {
                layout.places.push((EDGE, top, full, height, is_last));
            }
            layout.height += height + BETWEEN;
        }
        layout.height += NOTE * (1 + picture.notes.len() as i32) + EDGE;
        layout
    }

    const fn size(&self) -> (u32, u32) {
        (WIDTH, self.height.unsigned_abs())
    }

    fn draw<P: Pen>(
        &self,
        picture: &Picture,
        letters: &Letters,
        pen: &mut P,
    ) -> Result<(), Failure> {
        let canvas = Canvas { pen, letters, size: self.size() };
        let area = canvas.into_drawing_area();
        let drawn = self.draw_all(picture, &area);
        drawn.map_err(|problem| Failure::Failed(format!("cannot draw: {problem}")))
    }

    fn draw_all<P: Pen>(&self, picture: &Picture, area: &Area<'_, P>) -> Result<(), Problem> {
        area.fill(&RGBColor(0xFF, 0xFF, 0xFF))?;
        let title = text(LARGE, FontStyle::Bold, &INK, HPos::Left);
        area.draw_text(&picture.title, &title, (fine(EDGE), fine(14)))?;
        for (panel, place) in picture.panels.iter().zip(&self.places) {
            self.panel(panel, &picture.axis, *place, area)?;
        }
        let small = text(SMALL, FontStyle::Normal, &SOFT, HPos::Center);
        let mut below = self.height - EDGE - NOTE * (1 + picture.notes.len() as i32);
        let middle = fine((EDGE + self.left + WIDTH as i32 - EDGE - RIGHT) / 2);
        area.draw_text(&picture.axis.title, &small, (middle, fine(below)))?;
        let note = text(SMALL, FontStyle::Normal, &SOFT, HPos::Left);
        for line in &picture.notes {
            below += NOTE;
            area.draw_text(line, &note, (fine(EDGE), fine(below)))?;
        }
        Ok(())
    }

    fn panel<P: Pen>(
        &self,
        panel: &Panel,
        axis: &Axis,
        (left, top, width, height, has_labels): (i32, i32, i32, i32, bool),
        area: &Area<'_, P>,
    ) -> Result<(), Problem> {
        let area = area.clone().shrink(
            (fine(left), fine(top)),
            (fine(width).unsigned_abs(), fine(height).unsigned_abs()),
        );
        header(panel, width, &area)?;
        let is_half = panel.size == Size::Half;
        let begin = if is_half { self.left_of_half } else { self.left };
        let end = if is_half { self.right_of_half } else { RIGHT };
        let below = if has_labels { LABELS } else { 0 };
        let (low, high) = panel.range();
        let rows = panel.series.len() as f64;
        let y = if panel.size == Size::Rows { rows..0.0 } else { low..high };
        let x = 0.0..axis.span();
        let mut chart = ChartBuilder::on(&area)
            .margin_top(fine(HEADER))
            .margin_right(fine(end))
            .x_label_area_size(fine(below))
            .y_label_area_size(fine(begin))
            .build_cartesian_2d(x.clone(), y.clone())?;
        let is_rows = panel.size == Size::Rows;
        let labels_below = if is_half { LABELS_OF_HALF } else { 12 };
        let across = Labels::of(&ticks(x.clone(), labels_below));
        let up = Labels::of(&panel.ticks());
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(thick(0.8)))
            .axis_style(FRAME.stroke_width(thick(0.8)))
            .x_labels(labels_below)
            .y_labels(panel.labels())
            .x_label_formatter(&|x| across.text(*x))
            .y_label_formatter(&|y| up.text(*y))
            .label_style(text(SMALL, FontStyle::Normal, &SOFT, HPos::Left))
            .set_all_tick_mark_size(fine(3))
            .draw()?;
        if is_rows {
            return rows_of_ticks(panel, axis, &area, &mut chart, begin);
        }
        let (wide, high) = chart.plotting_area().dim_in_pixel();
        let scale = (pixels(wide) / (x.end - x.start), pixels(high) / (y.end - y.start));
        for series in &panel.series {
            curve(series, axis, scale, &x, &mut chart)?;
        }
        Ok(())
    }
}

/// Labels below a panel of half the width, at most.
const LABELS_OF_HALF: usize = 6;

/// Where the labels of an axis are.
fn ticks(range: Range<f64>, most: usize) -> Vec<f64> {
    RangedCoordf64::from(range).key_points(most)
}

impl Panel {
    /// Height of the part with the curves.
    fn height(&self) -> i32 {
        match self.size {
            Size::Tall => 190,
            Size::Low => 96,
            Size::Half => 84,
            Size::Rows => ROW * self.series.len() as i32,
        }
    }

    /// Number of labels at the left, at most.
    fn labels(&self) -> usize {
        match self.size {
            Size::Rows => 0,
            _ => self.height().unsigned_abs() as usize / 28 + 1,
        }
    }

    /// Where they are.
    fn ticks(&self) -> Vec<f64> {
        let (low, high) = self.range();
        ticks(low..high, self.labels())
    }
}

/// The title of a panel, and its legend at the right.
fn header<P: Pen>(panel: &Panel, width: i32, area: &Area<'_, P>) -> Result<(), Problem> {
    let bold = text(NORMAL, FontStyle::Bold, &INK, HPos::Left);
    let soft = text(SMALL, FontStyle::Normal, &SOFT, HPos::Left);
    let middle = fine(HEADER / 2);
    area.draw_text(panel.title, &bold, (0, middle))?;
    let mut x = area.estimate_text_size(panel.title, &bold)?.0 as i32;
    if !panel.unit.is_empty() {
        let unit = format!(", {}", panel.unit);
        area.draw_text(&unit, &soft, (x, middle))?;
        x += area.estimate_text_size(&unit, &soft)?.0 as i32;
    }
    if !panel.hint.is_empty() {
        area.draw_text(panel.hint, &soft, (x + fine(14), middle))?;
    }
    let mut x = fine(width);
    for series in panel.series.iter().rev().filter(|series| series.is_named) {
        x -= area.estimate_text_size(&series.name, &soft)?.0 as i32;
        area.draw_text(&series.name, &soft, (x, middle))?;
        x -= fine(8);
        let dot = Circle::new((x, middle), fine(3), colour(series.colour).filled());
        area.draw(&dot)?;
        x -= fine(14);
    }
    Ok(())
}

fn curve<P: Pen>(
    series: &Series,
    axis: &Axis,
    scale: (f64, f64),
    x: &Range<f64>,
    chart: &mut Chart<'_, '_, P>,
) -> Result<(), Problem> {
    let columns = &series.columns;
    if series.look == Look::Dots {
        return dots(series, axis, scale, chart);
    }
    let style = match series.look {
        Look::Held | Look::Wide => colour(series.colour).mix(0.28).stroke_width(thick(4.0)),
        _ => colour(series.colour).mix(1.0).stroke_width(thick(1.2)),
    };
    let mut pieces = columns.pieces_and_ends().peekable();
    while let Some((piece, end)) = pieces.next() {
        let mut points: Vec<_> = piece.iter().map(|point| (axis.of(point.x), point.y)).collect();
        if matches!(series.look, Look::Held | Look::Step) {
            points = stairs(&points);
            if let (Some(end), Some((_, y))) = (end, points.last().copied()) {
                points.push((axis.of(end), y));
            }
            // It holds until somebody says otherwise.
            let is_open = series.look == Look::Held && !columns.is_ended();
            if let Some((_, y)) = points.last().copied().filter(|_| is_open)
                && pieces.peek().is_none()
            {
                points.push((x.end, y));
            }
        }
        if let [point] = *points {
            let dot = Circle::new(point, thick(0.9), colour(series.colour).filled());
            chart.draw_series([dot])?;
            continue;
        }
        let points = simplified(&points, scale);
        chart.draw_series([PathElement::new(points, style)])?;
    }
    Ok(())
}

/// One dot for those that are drawn on the same place.
fn dots<P: Pen>(
    series: &Series,
    axis: &Axis,
    scale: (f64, f64),
    chart: &mut Chart<'_, '_, P>,
) -> Result<(), Problem> {
    let style = colour(series.colour).mix(0.75).filled();
    let mut drawn = std::collections::BTreeSet::new();
    let points = series.columns.pieces().flatten().map(|point| (axis.of(point.x), point.y));
    let seen = points.filter(|(x, y)| {
        let cell = |value: f64, scale: f64| (value * scale / 1.5).round() as i64;
        drawn.insert((cell(*x, scale.0), cell(*y, scale.1)))
    });
    let dots: Vec<_> = seen.map(|point| Circle::new(point, thick(1.0), style)).collect();
    chart.draw_series(dots)?;
    Ok(())
}

fn rows_of_ticks<P: Pen>(
    panel: &Panel,
    axis: &Axis,
    area: &Area<'_, P>,
    chart: &mut Chart<'_, '_, P>,
    begin: i32,
) -> Result<(), Problem> {
    let label = text(SMALL, FontStyle::Normal, &SOFT, HPos::Right);
    let total = text(SMALL, FontStyle::Normal, &SOFT, HPos::Left);
    let (width, _) = area.dim_in_pixel();
    for (row, series) in panel.series.iter().enumerate() {
        let middle = fine(HEADER + ROW / 2 + ROW * row as i32);
        area.draw_text(&series.name, &label, (fine(begin - 8), middle))?;
        let count = format!("{}×", series.columns.count());
        area.draw_text(&count, &total, (width as i32 - fine(RIGHT - 6), middle))?;
        let style = colour(series.colour).mix(0.85).stroke_width(thick(1.2));
        let (top, bottom) = (row as f64 + 0.18, row as f64 + 0.82);
        let mut last = f64::NEG_INFINITY;
        let scale = pixels(chart.plotting_area().dim_in_pixel().0) / axis.span();
        let seen = series.columns.counts().map(|(x, _)| axis.of(x)).filter(|x| {
            let is_seen = (x - last) * scale > 0.8;
            if is_seen {
                last = *x;
            }
            is_seen
        });
        let ticks: Vec<_> =
            seen.map(|x| PathElement::new(vec![(x, top), (x, bottom)], style)).collect();
        chart.draw_series(ticks)?;
    }
    Ok(())
}

/// A value holds until the next.
fn stairs(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut stairs: Vec<(f64, f64)> = Vec::with_capacity(2 * points.len());
    for (x, y) in points {
        match stairs.last() {
            Some((_, before)) if before != y => stairs.push((*x, *before)),
            _ => {}
        }
        stairs.push((*x, *y));
    }
    stairs
}

/// The points without those that are on a line between others, as far as one sees (the algorithm of
/// Ramer, Douglas and Peucker).
fn simplified(points: &[(f64, f64)], (wide, high): (f64, f64)) -> Vec<(f64, f64)> {
    let mut is_kept = vec![false; points.len()];
    let mut parts = vec![(0, points.len().saturating_sub(1))];
    while let Some((first, last)) = parts.pop() {
        let ends = [first, last].map(|end| points.get(end).copied().unwrap_or_default());
        let [(x0, y0), (x1, y1)] = ends;
        let (dx, dy) = ((x1 - x0) * wide, (y1 - y0) * high);
        let length = dx.hypot(dy);
        let inner = points.iter().enumerate().take(last).skip(first + 1);
        let far = inner.map(|(at, (x, y))| {
            let (px, py) = ((x - x0) * wide, (y - y0) * high);
            let distance = match length {
                0.0 => px.hypot(py),
                length => (dx * py - dy * px).abs() / length,
            };
            (at, distance)
        });
        let farthest = far.max_by(|(_, one), (_, other)| one.total_cmp(other));
        for end in [first, last] {
            is_kept.get_mut(end).into_iter().for_each(|kept| *kept = true);
        }
        if let Some((at, _)) = farthest.filter(|(_, distance)| *distance > TOLERANCE) {
            parts.extend([(first, at), (at, last)]);
        }
    }
    points.iter().zip(is_kept).filter(|(_, kept)| *kept).map(|(point, _)| *point).collect()
}

/// Pixels as coordinates.
const fn fine(pixels: i32) -> i32 {
    pixels * FINE
}

/// The same for the width of a line.
fn thick(pixels: f64) -> u32 {
    (pixels * f64::from(FINE)).round() as u32
}

/// Coordinates as pixels.
fn pixels(coordinates: u32) -> f64 {
    f64::from(coordinates) / f64::from(FINE)
}

fn colour(number: usize) -> RGBAColor {
    let (red, green, blue) = PALETTE.get(number).copied().unwrap_or_default();
    RGBColor(red, green, blue).to_rgba()
}

/// The style of a text, which is in the middle of its height.
fn text(size: f64, weight: FontStyle, colour: &'static RGBColor, side: HPos) -> TextStyle<'static> {
    let font = ("sans-serif", size * f64::from(FINE), weight).into_font();
    TextStyle::from(font).color(colour).pos(Pos::new(side, VPos::Center))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_what_is_seen() {
        let mut points: Vec<_> = (0..1000).map(|x| (f64::from(x), 0.0)).collect();
        points[500].1 = 1.0;
        assert_eq!(simplified(&points, (1.0, 0.1)), [(0.0, 0.0), (999.0, 0.0)]);
        let seen = simplified(&points, (1.0, 1.0));
        assert_eq!(seen, [0, 499, 500, 501, 999].map(|at| points[at]));
        assert_eq!(simplified(&[], (1.0, 1.0)), []);
    }

    #[test]
    fn a_held_value_makes_stairs() {
        let stairs = stairs(&[(0.0, 1.0), (1.0, 1.0), (2.0, 3.0)]);
        assert_eq!(stairs, [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (2.0, 3.0)]);
    }
}
