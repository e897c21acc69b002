//! The pen for PNG.

use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform,
};

use super::{
    canvas::{Ink, Pen, Place, Text},
    letters::{Letters, Outline},
};
use crate::failure::Failure;

/// Dots of the file per pixel of the picture: for screens that have as many.
pub(super) const SCALE: u32 = 2;

/// The dots of a picture.
pub(super) struct Png(Pixmap);

impl Png {
    /// A white picture of this size in pixels.
    pub(super) fn new((width, height): (u32, u32)) -> Result<Self, Failure> {
        let pixmap = Pixmap::new(width * SCALE, height * SCALE);
        let mut pixmap =
            pixmap.ok_or_else(|| Failure::Failed("the picture is too large".into()))?;
        pixmap.fill(Color::WHITE);
        Ok(Self(pixmap))
    }

    /// The file.
    pub(super) fn finish(self) -> Result<Vec<u8>, Failure> {
        let encoded = self.0.encode_png();
        encoded.map_err(|error| Failure::Failed(format!("cannot make a PNG: {error}")))
    }

    fn stroke(&mut self, path: &Path, width: f32, line_cap: LineCap, ink: Ink) {
        let stroke = Stroke { width, line_cap, line_join: LineJoin::Round, ..Stroke::default() };
        self.0.stroke_path(path, &paint(ink), &stroke, scaled(), None);
    }
}

impl Pen for Png {
    fn line(&mut self, points: &[Place], width: f32, ink: Ink) {
        if let Some(path) = path(points) {
            self.stroke(&path, width, LineCap::Butt, ink);
        }
    }

    fn dot(&mut self, (x, y): Place, radius: f32, ink: Ink) {
        if let Some(path) = PathBuilder::from_circle(x, y, radius) {
            self.0.fill_path(&path, &paint(ink), FillRule::Winding, scaled(), None);
        }
    }

    fn area(&mut self, corners: &[Place], ink: Ink) {
        if let Some(path) = path(corners) {
            self.0.fill_path(&path, &paint(ink), FillRule::Winding, scaled(), None);
        }
    }

    fn text(&mut self, text: &Text<'_>, (x, y): Place, letters: &Letters) {
        let Text { text, size, is_bold, ink, before } = *text;
        let begin = x - before * letters.width(text, size, is_bold);
        let mut outline = Glyphs(PathBuilder::new());
        letters.outline(text, size, is_bold, (begin, y), &mut outline);
        if let Some(path) = outline.0.finish() {
            self.0.fill_path(&path, &paint(ink), FillRule::Winding, scaled(), None);
        }
    }
}

/// `None` for fewer than two points, and for points that are all the same.
fn path(points: &[Place]) -> Option<Path> {
    let mut path = PathBuilder::new();
    let ((x, y), rest) = points.split_first()?;
    path.move_to(*x, *y);
    rest.iter().for_each(|(x, y)| path.line_to(*x, *y));
    path.finish()
}

fn paint(ink: Ink) -> Paint<'static> {
    let (red, green, blue) = ink.rgb;
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (ink.opacity * 255.0).round() as u8);
    paint
}

fn scaled() -> Transform {
    Transform::from_scale(SCALE as f32, SCALE as f32)
}

struct Glyphs(PathBuilder);

impl Outline for Glyphs {
    fn go(&mut self, (x, y): Place) {
        self.0.move_to(x, y);
    }

    fn line(&mut self, (x, y): Place) {
        self.0.line_to(x, y);
    }

    fn curve(&mut self, (x1, y1): Place, (x, y): Place) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}
